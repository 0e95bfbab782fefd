"""Cameras and front LiDAR in one estimate: against truth and differences; wrong returns refused by name."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from session_files import (
    BOARD,
    Session,
    lidar_from,
    observations,
    places,
    rig_of,
    save,
    settings,
    views_of,
)

from card.artifacts import read_json
from card.calibration.cameras import calibrate_cameras
from card.calibration.front_lidar import calibrate_front_lidar
from card.calibration.lidar_estimate import FrontLidar, estimate_front_lidar
from card.calibration.lidar_start import Drawn
from card.calibration.plane_alignment import align_planes
from card.calibration.return_residuals import BoardReturns
from card.calibration.session_sweeps import sweeps_of
from card.calibration.state import State, intrinsics_of, moved, step_between
from card.errors import CardError
from card.geometry import from_json, inverse, transform
from card.recording.burst import Burst
from card.simulation.board_scene import board_quads
from card.simulation.board_sweep import sweep
from card.simulation.drawing import drawing
from card.simulation.quads import Quad
from card.simulation.rig import CAMERAS

COUNT = 30


def run(session: Session, out: Path, **changed: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    stated = {"board": session.board, "boards": session.boards, "settings": settings(**changed), "gates": []}
    calibrate_cameras(cameras=out / "cameras.json", report=out / "cameras.report.json", **stated)
    calibrate_front_lidar(
        session=session.folder,
        cameras=out / "cameras.json",
        drawing=session.drawing,
        front_lidar=out / "front_lidar.json",
        report=out / "front_lidar.report.json",
        **stated,
    )
    document = read_json(out / "front_lidar.json", "front_lidar_calibration")
    return document, read_json(out / "front_lidar.report.json", "report")


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return save(tmp_path_factory.mktemp("session") / "s", observations(1, COUNT), rig_of(1))


@pytest.fixture(scope="module")
def estimated(
    session: Session, tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict[str, Any], dict[str, Any]]:
    return run(session, tmp_path_factory.mktemp("out"))


@pytest.mark.parametrize("camera", CAMERAS)
def test_both_cameras_are_placed_in_the_lidar_within_what_it_says(
    session: Session, estimated: tuple[dict[str, Any], dict[str, Any]], camera: str
) -> None:
    document, _ = estimated
    error = step_between(from_json(document[f"lidar_front_from_{camera}"]), lidar_from(session.rig, camera))
    assert np.degrees(np.linalg.norm(error[3:])) < 0.06
    assert np.linalg.norm(error[:3]) < 5e-3
    covariance = np.array(document["covariances"][f"lidar_front_from_{camera}"])
    assert error @ np.linalg.solve(covariance, error) < 16.8  # 99 % of chi squared with 6 degrees of freedom


def test_the_document_says_how_good_it_is(estimated: tuple[dict[str, Any], dict[str, Any]]) -> None:
    document, report = estimated
    quality = document["quality"]
    assert quality["views"] >= 0.9 * COUNT
    assert quality["range_sigma_m"] == pytest.approx(0.0051, rel=0.06)
    assert quality["starts_agreed"] == quality["starts"] == 6
    assert 0 < quality["split_half_deg"] < 0.2
    assert 0 < quality["split_half_mm"] < 20
    assert quality["closed_form_mm"] < 20
    assert quality["inliers"] / quality["returns"] == pytest.approx(0.954, abs=0.01)
    assert document["verdict"] == {"passed": True, "reasons": []}
    assert report["counts"]["returns"] == quality["returns"]


def test_corrections_are_found_where_the_boards_tell(
    session: Session, estimated: tuple[dict[str, Any], dict[str, Any]]
) -> None:
    document, _ = estimated
    true = session.rig.lidar_corrections["lidar_front"]
    for name in ("range_offset_m", "channel_range_offset_m", "channel_elevation_offset_rad"):
        found, sigma = (np.atleast_1d(document[part][name]) for part in ("corrections", "sigmas"))
        error = found - np.atleast_1d(getattr(true, name))
        assert np.abs(error / sigma).max() < 4
    prior = settings()["front_lidar"]["channel_range_sigma_m"]
    sigma = np.array(document["sigmas"]["channel_range_offset_m"])
    assert sigma.min() < 0.5 * prior
    assert sigma.max() < prior


def test_derivatives_of_the_returns_are_those_of_differences() -> None:
    rig, rng = rig_of(1), np.random.default_rng(3)
    left_from_board = np.tile(np.eye(4), (2, 1, 1))
    left_from_board[:, :3, 3] = [[0.3, -0.2, 3.0], [-0.5, 0.1, 4.0]]
    points = rng.uniform([-1, 2, -1], [1, 4, 1], (2, 5, 3))
    points[1, 4] = np.nan
    block = BoardReturns(points, rng.integers(0, 32, (2, 5)).astype(np.uint8), rng.uniform(0.5, 1, (2, 5)))
    state = State(np.zeros((2, 9)), np.eye(4), lidar_from(rig, "camera_left"), np.zeros(97), left_from_board)
    state = state.moved(0.01 * rng.normal(size=127), 0.1 * rng.normal(size=(2, 6)))
    linear = block.linear(state)
    np.testing.assert_allclose(linear.residual, block.residual(state))
    there = np.isfinite(linear.residual)
    assert there.sum() == 9
    for number, column in enumerate(block.columns):
        step = np.zeros(127)
        step[column] = 1e-6
        ahead, back = (block.residual(state.moved(sign * step, np.zeros((2, 6)))) for sign in (1, -1))
        np.testing.assert_allclose(linear.shared[there, number], (ahead - back)[there] / 2e-6, atol=1e-7)
    for axis in range(6):
        step = np.zeros((2, 6))
        step[:, axis] = 1e-6
        ahead, back = (block.residual(state.moved(np.zeros(127), sign * step)) for sign in (1, -1))
        np.testing.assert_allclose(linear.pose[there, axis], (ahead - back)[there] / 2e-6, atol=1e-7)


def truth_of(session: Session) -> State:
    """The true cameras and board poses; what is wrong in the tests below are returns."""
    rig = session.rig
    left_from_board = inverse(rig.rig_from["camera_left"]) @ places(1, COUNT)
    intrinsics = np.array([intrinsics_of(rig.cameras[name]) for name in CAMERAS])
    stereo = inverse(rig.rig_from["camera_left"]) @ rig.rig_from["camera_right"]
    return State(intrinsics, stereo, np.eye(4), np.zeros(97), left_from_board)


def estimate(
    session: Session, bursts: Sequence[Burst | None], drawn: Drawn | None = None, **changed: Any
) -> FrontLidar:
    stated = settings(**{"starts": 2, "max_returns": 100, **changed})["front_lidar"] | {
        "corner_sigma_px": 0.05
    }
    views = views_of(session.observed, session.rig)
    drawn = drawn or Drawn.of(drawing("full"))
    return estimate_front_lidar(views, bursts, truth_of(session), BOARD, drawn, stated, "session")


def error_of(found: FrontLidar, session: Session) -> tuple[float, float]:
    step = step_between(found.solution.state.lidar_from_left, lidar_from(session.rig, "camera_left"))
    return float(np.degrees(np.linalg.norm(step[3:]))), 1e3 * float(np.linalg.norm(step[:3]))


def seen_with(
    session: Session, views: Iterable[int], size_m: tuple[float, float], behind_m: float, *, board: bool
) -> list[Burst]:
    """The session's sweeps, in some views with a surface parallel to the board and behind its middle."""
    bursts, rng = list(session.observed.bursts), np.random.default_rng(9)
    for view in views:
        pose = places(1, COUNT)[view]
        corner = pose @ transform([*(BOARD.centre_m[:2] - np.divide(size_m, 2)), behind_m])
        surface = Quad(corner, size_m, np.full((4, 4, 3), 150, np.uint8), 150)
        quads = [surface, *board_quads(pose)] if board else [surface]
        bursts[view] = sweep(session.rig, quads, 400, view, bursts[view].t_ns, rng)
    return bursts


def test_a_wall_close_behind_every_board_does_not_matter(session: Session) -> None:
    bursts = seen_with(session, range(COUNT), (3.0, 3.0), 0.1, board=True)
    found = estimate(session, bursts)
    assert sum(bool(reason) for reason in found.reasons) <= 2
    degrees, millimetres = error_of(found, session)
    assert degrees < 0.06
    assert millimetres < 5


def test_views_in_which_the_lidar_saw_the_wall_instead_are_refused_by_name(session: Session) -> None:
    walls = [3, 11, 12, 29]
    found = estimate(session, seen_with(session, walls, (3.0, 3.0), 0.1, board=False))
    for view in walls:
        assert "a plane that goes on beyond the board" in found.reasons[view]
    degrees, millimetres = error_of(found, session)
    assert degrees < 0.06
    assert millimetres < 5


def test_a_surface_of_the_size_of_the_board_behind_it_is_found_out(session: Session) -> None:
    decoys = [2, 9, 16, 23]
    found = estimate(session, seen_with(session, decoys, (1.13, 0.8), 0.09, board=False))
    for view in decoys:
        assert "returns within 0.03 m of the board: those found lie elsewhere" in found.reasons[view]
    degrees, millimetres = error_of(found, session)
    assert degrees < 0.06
    assert millimetres < 5


def test_a_session_of_walls_is_refused_and_a_view_named(session: Session) -> None:
    bursts = seen_with(session, range(COUNT), (3.0, 3.0), 0.1, board=False)
    message = r"too few views with returns .*0 of 30; view 2000000000: returns are of a plane that goes on"
    with pytest.raises(CardError, match=message):
        estimate(session, bursts)


def test_sweeps_shifted_by_one_view_are_refused(session: Session) -> None:
    bursts = session.observed.bursts[1:] + session.observed.bursts[:1]
    with pytest.raises(CardError, match=r"too few views with returns of the board .*view 2000000000: "):
        estimate(session, bursts)


def test_a_drawing_that_is_degrees_off_will_do(session: Session) -> None:
    rng = np.random.default_rng(4)
    sigmas = [0.03] * 3 + [np.radians(1.5)] * 3
    drawn = Drawn(moved(lidar_from(session.rig, "camera_left"), rng.normal(0, sigmas)), 0.03, np.radians(1.5))
    found = estimate(session, session.observed.bursts, drawn, starts=4)
    assert sum(not reason for reason in found.reasons) > 0.8 * COUNT
    assert found.starts_agreed == found.starts
    degrees, millimetres = error_of(found, session)
    assert degrees < 0.06
    assert millimetres < 5


def test_views_without_a_sweep_are_left_out(session: Session, tmp_path: Path) -> None:
    bursts: list[Burst | None] = list(session.observed.bursts)
    bursts[5] = None
    assert estimate(session, bursts).reasons[5] == "no sweep of the LiDAR at its time"
    (tmp_path / "lidar_front").mkdir()
    with pytest.raises(CardError, match="session has no sweeps of the board"):
        list(sweeps_of(tmp_path / "lidar_front", [1]))
    times = session.observed.t_ns.tolist()
    found = list(sweeps_of(session.folder, [times[0], times[0] + 10**9, times[1]]))
    assert [None if burst is None else burst.t_ns for burst in found] == [
        session.observed.bursts[0].t_ns,
        None,
        session.observed.bursts[1].t_ns,
    ]


def test_the_closed_form_is_exact_without_noise_and_leaves_wrong_planes_out() -> None:
    rng = np.random.default_rng(6)
    true = transform([0.3, -0.1, 0.2], rng.normal(size=4))
    normals = rng.normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = rng.uniform(1, 5, 20)
    turned = normals @ true[:3, :3].T
    moved_offsets = offsets + turned @ true[:3, 3]
    moved_offsets[[4, 9]] += 0.5
    found = align_planes(turned, moved_offsets, normals, offsets)
    np.testing.assert_allclose(found, true, atol=1e-9)


def test_same_input_gives_the_same_bytes(session: Session, tmp_path: Path) -> None:
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        run(session, tmp_path / name, starts=2, max_returns=50)
    for name in ("cameras.json", "front_lidar.json", "front_lidar.report.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()


def test_detections_of_another_session_are_refused(session: Session, tmp_path: Path) -> None:
    run(session, tmp_path, starts=2, max_returns=50)
    few = replace(
        session.observed, t_ns=session.observed.t_ns[:20], pixels=session.observed.pixels[:, :20], bursts=[]
    )
    other = save(tmp_path / "other", few, session.rig)
    with pytest.raises(CardError, match=r"detections are not those of the camera calibration.*no view 42000"):
        calibrate_front_lidar(
            session=session.folder,
            boards=other.boards,
            cameras=tmp_path / "cameras.json",
            board=session.board,
            drawing=session.drawing,
            front_lidar=tmp_path / "new.json",
            report=tmp_path / "new.report.json",
            settings=settings(),
            gates=[],
        )
    assert not list(tmp_path.glob("new*"))
