"""Cameras and front LiDAR in one estimate: against truth and differences; wrong returns refused by name."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from board_sessions import Session, lidar_from, observations, rig_of, save, settings

from card.artifacts import read_json
from card.calibration.cameras import calibrate_cameras
from card.calibration.front_lidar import calibrate_front_lidar
from card.calibration.return_residuals import BoardReturns
from card.calibration.state import State, step_between
from card.geometry import from_json
from card.simulation.rig import CAMERAS

COUNT = 40


def run(session: Session, out: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    stated = {"board": session.board, "boards": session.boards, "settings": settings(), "gates": []}
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
