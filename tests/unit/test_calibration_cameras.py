"""The cameras from board views: OpenCV and numeric derivatives as witnesses, bad sessions refused by name."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from session_files import (
    BOARD,
    NOISE_PX,
    Session,
    left_from_right,
    observations,
    rig_of,
    save,
    settings,
    views_of,
)

from card.artifacts import read_json
from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.calibration.camera_estimate import CAMERA_COLUMNS, camera_problem, estimate_cameras
from card.calibration.camera_start import camera_from_board, opencv_stereo, start_intrinsics
from card.calibration.cameras import calibrate_cameras
from card.calibration.chessboard import find_chessboard
from card.calibration.corner_residuals import Corners
from card.calibration.robust_least_squares import Problem, solve
from card.calibration.state import STEREO, State, intrinsics_of, step_between
from card.errors import CardError
from card.geometry import from_json, inverse
from card.simulation.board_observations import observe
from card.simulation.rig import CAMERAS

COUNT = 40
SETTINGS = settings()["cameras"]


def views(seed: int = 1, count: int = COUNT) -> BoardViews:
    return views_of(observations(seed, count, columns=90), rig_of(seed))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    return save(tmp_path_factory.mktemp("session") / "s", observations(1, COUNT, columns=90), rig_of(1))


def run(session: Session, out: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    calibrate_cameras(
        boards=session.boards,
        board=session.board,
        cameras=out / "cameras.json",
        report=out / "cameras.report.json",
        settings=settings(),
        gates=[{"figure": "stereo_reprojection_px", "unit": "px", "better": "lower", "threshold": 0.3}],
    )
    document = read_json(out / "cameras.json", "camera_calibration")
    return document, read_json(out / "cameras.report.json", "report")


def test_the_document_holds_the_estimate_and_says_how_good_it_is(session: Session, tmp_path: Path) -> None:
    document, report = run(session, tmp_path)
    error = step_between(left_from_right(session.rig), from_json(document["left_from_right"]))
    assert np.degrees(np.linalg.norm(error[3:])) < 0.02
    assert np.linalg.norm(error[:3]) < 1e-3
    quality = document["quality"]
    assert quality["views"] == COUNT
    assert quality["corners"] == 2 * COUNT * 40
    assert quality["corner_sigma_px"] == pytest.approx(NOISE_PX, rel=0.05)
    assert quality["reprojection_rms_px"] == pytest.approx(np.sqrt(2) * NOISE_PX, rel=0.05)
    # Huber's threshold at two sigmas leaves 95 % of each coordinate inside.
    assert quality["inliers"] / quality["corners"] == pytest.approx(0.954**2, abs=0.02)
    assert document["verdict"] == {"passed": True, "reasons": []}
    assert [gate["verdict"] for gate in report["gates"]] == ["pass"]
    assert quality["opencv_distance_mm"] < 0.5
    assert all(view["used"] and view["rms_left_px"] < 0.4 for view in document["views"])


def test_derivatives_of_the_corners_are_those_of_differences() -> None:
    observed = views(count=3)
    rig = rig_of(1)
    rng = np.random.default_rng(3)
    left = camera_from_board(observed.pixels[0], BOARD, intrinsics_of(rig.cameras["camera_left"]))
    intrinsics = np.array([intrinsics_of(rig.cameras[name]) for name in CAMERAS])
    state = State(intrinsics, left_from_right(rig), np.eye(4), np.zeros(97), left)
    state = state.moved(0.01 * rng.normal(size=127), 0.01 * rng.normal(size=(3, 6)))
    for side in range(2):
        block = Corners(side, BOARD.corners_m, observed.pixels[side])
        linear = block.linear(state)
        np.testing.assert_allclose(linear.residual, block.residual(state))
        for number, column in enumerate(block.columns):
            step = np.zeros(127)
            step[column] = 1e-6
            none = np.zeros((3, 6))
            slope = (
                block.residual(state.moved(step, none)) - block.residual(state.moved(-step, none))
            ) / 2e-6
            scale = np.abs(slope).max()
            np.testing.assert_allclose(linear.shared[..., number], slope, atol=1e-6 * scale + 1e-5)
        for axis in range(6):
            step = np.zeros((3, 6))
            step[:, axis] = 1e-6
            none = np.zeros(127)
            slope = (
                block.residual(state.moved(none, step)) - block.residual(state.moved(none, -step))
            ) / 2e-6
            np.testing.assert_allclose(linear.pose[..., axis], slope, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("side", [0, 1])
def test_opencv_finds_the_same_intrinsics(side: int) -> None:
    observed = views()
    state = opencv_state(observed)
    state = replace(state, intrinsics=state.intrinsics[[side, side]])
    left = camera_from_board(observed.pixels[side], BOARD, state.intrinsics[0])
    # Huber's threshold so far out that nothing loses weight: least squares, as OpenCV's.
    block = Corners(0, BOARD.corners_m, observed.pixels[side])
    problem = Problem([block], [NOISE_PX], CAMERA_COLUMNS[:9], 50.0, np.ones(97))
    found = solve(
        replace(state, left_from_board=left).moved(np.full(127, 1e-3), np.zeros((COUNT, 6))), problem
    )
    sigmas = np.sqrt(np.diag(found.covariance))[:9]
    assert np.abs((found.state.intrinsics[0] - state.intrinsics[0]) / sigmas).max() < 0.05


def test_opencv_finds_the_same_stereo_pose() -> None:
    observed = views(count=12)
    true = np.array([intrinsics_of(rig_of(1).cameras[name]) for name in CAMERAS])
    state = replace(opencv_state(observed), intrinsics=true)
    problem = replace(camera_problem(observed, BOARD, SETTINGS), free=CAMERA_COLUMNS[18:], huber=50.0)
    found = solve(state.moved(np.r_[np.zeros(18), np.full(109, 1e-3)], np.zeros((12, 6))), problem)
    expected = opencv_stereo(observed, BOARD, state.intrinsics, 12)
    sigmas = np.sqrt(np.diag(found.covariance))[STEREO]
    assert np.abs(step_between(found.state.left_from_right, expected) / sigmas).max() < 0.1


def opencv_state(observed: BoardViews) -> State:
    """OpenCV's intrinsics, the board poses of the left camera alone, the true stereo pose."""
    intrinsics = start_intrinsics(observed, BOARD, len(observed))
    left = camera_from_board(observed.pixels[0], BOARD, intrinsics[0])
    return State(intrinsics, left_from_right(rig_of(1)), np.eye(4), np.zeros(97), left)


def test_wrong_corners_lose_their_say_and_a_wrong_view_is_named() -> None:
    observed = views()
    rng = np.random.default_rng(5)
    pixels = observed.pixels.copy()
    wrong = rng.random(pixels.shape[:3]) < 0.03
    pixels[wrong] += rng.normal(0, 3, (wrong.sum(), 2))
    pixels[1, 7] = pixels[1, 8]  # one right image of another moment
    pixels[0, 12] += rng.normal(0, 8, (40, 2))  # corners of a smeared image
    found = estimate_cameras(replace(observed, pixels=pixels), BOARD, SETTINGS, "here")
    assert [i for i in range(COUNT) if not found.used[i]] == [7, 12]
    assert found.reasons[7] == "its images do not agree on the stereo pose of the others"
    assert "reprojection error" in found.reasons[12] or "agree" in found.reasons[12]
    error = step_between(found.solution.state.left_from_right, left_from_right(rig_of(1)))
    assert np.linalg.norm(error[:3]) < 1e-3
    assert np.degrees(np.linalg.norm(error[3:])) < 0.02


@pytest.mark.parametrize("by", [1, -1])
def test_pairs_shifted_by_one_are_refused(by: int) -> None:
    observed = views()
    pixels = observed.pixels.copy()
    pixels[1] = np.roll(pixels[1], by, axis=0)
    first = observed.names[:2] if by == 1 else observed.names[:2][::-1]
    message = rf"right images are shifted by one pair: that of view {first[1]} belongs to view {first[0]}"
    with pytest.raises(CardError, match=message):
        estimate_cameras(replace(observed, pixels=pixels), BOARD, SETTINGS, "here")


def test_pairs_in_disorder_are_refused() -> None:
    observed = views()
    pixels = observed.pixels.copy()
    pixels[1] = pixels[1][np.random.default_rng(1).permutation(COUNT)]
    with pytest.raises(CardError, match=r"do not show one board .*of 40 views agree.*view \d+ does not"):
        estimate_cameras(replace(observed, pixels=pixels), BOARD, SETTINGS, "here")


def test_left_and_right_swapped_are_refused() -> None:
    observed = views()
    swapped = replace(observed, pixels=observed.pixels[::-1])
    with pytest.raises(CardError, match=r"camera_left and camera_right are swapped .*baseline -0\.[56]\d* m"):
        estimate_cameras(swapped, BOARD, SETTINGS, "here")


def test_boards_that_are_all_central_or_all_frontal_are_refused() -> None:
    rig, rng = rig_of(1), np.random.default_rng(2)
    poses = []
    for spread_m in (0.1, 1.0):
        # Upright and facing the cameras: x right, y down, z ahead of the left one.
        shift = np.array([0.3, 0.0, 2.5]) + rng.uniform(-spread_m, spread_m, (COUNT, 3))
        pose = np.tile(np.eye(4), (COUNT, 1, 1))
        pose[:, :3, 3] = shift - BOARD.centre_m
        poses.append(rig.rig_from["camera_left"] @ pose)
    for pose, message in zip(
        poses,
        (
            r"boards cover too little of the image of camera_left .*outermost board in view \d+",
            r"boards all face the camera .*most in view \d+.*lean and turn",
        ),
        strict=True,
    ):
        observed = views_of(observe(rig, pose, noise_px=NOISE_PX, columns=90, rng=rng), rig)
        with pytest.raises(CardError, match=message):
            estimate_cameras(observed, BOARD, SETTINGS, "here")


def test_too_few_views_are_listed() -> None:
    with pytest.raises(CardError, match=r"too few views .*2: 2000000000, 4000000000, wanted 8 or more"):
        estimate_cameras(views().of(np.arange(2)), BOARD, SETTINGS, "here")


def test_nothing_is_written_of_a_refused_session(session: Session, tmp_path: Path) -> None:
    observed = session.observed
    bad = save(tmp_path / "bad", replace(observed, pixels=observed.pixels[::-1]), session.rig)
    with pytest.raises(CardError, match="swapped"):
        run(bad, tmp_path)
    assert not list(tmp_path.glob("cameras*"))


def test_real_images_give_published_intrinsics() -> None:
    """Six images of an automotive camera; SOURCE.txt beside them has OpenCV's figures."""
    data = os.environ.get("CARD_TEST_DATA")
    if not data or not Path(data, "camera_chessboard").is_dir():
        pytest.skip("CARD_TEST_DATA has no camera_chessboard")
    images = sorted(Path(data, "camera_chessboard").glob("*.jpg"))
    real = Board(15, 17, 0.05, np.array([0.8, 0.9]), np.array([-0.05, -0.05]))
    pixels = []
    for image in images:
        corners, reason = find_chessboard(
            cv2.imread(str(image), cv2.IMREAD_GRAYSCALE), 15, 17, settings()["boards"]
        )
        assert corners is not None, reason
        pixels.append(corners)
    views = BoardViews(tuple(p.stem for p in images), np.arange(6), np.array([pixels, pixels]), (1920, 1200))
    start = start_intrinsics(views, real, 6)
    left = camera_from_board(views.pixels[0], real, start[0])
    problem = replace(camera_problem(views, real, SETTINGS), free=CAMERA_COLUMNS[:9])
    problem = Problem(problem.blocks[:1], [0.2], problem.free, problem.huber, problem.prior_sigma)
    found = solve(State(start, np.eye(4), np.eye(4), np.zeros(97), left), problem)
    fx, fy, cx, cy = found.state.intrinsics[0, :4]
    rms = np.sqrt(2 * np.mean(found.residuals[0] ** 2))
    print(f"real images: rms {rms:.3f} px, fx {fx:.2f} fy {fy:.2f} cx {cx:.2f} cy {cy:.2f}")
    assert rms < 0.26
    # Split halves of all 22 images agree to 1.3 px.
    assert np.abs([fx - 1058.17, fy - 1059.79]).max() < 1.3
    assert abs(cx - 962.57) < 1.3
    assert abs(cy - 584.76) < 2.0
    assert inverse(left).shape == (6, 4, 4)
