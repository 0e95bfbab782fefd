"""Cameras and front LiDAR against the truth over simulated sessions: errors, and whether sigmas tell them."""

from dataclasses import dataclass

import numpy as np
import pytest
from board_sessions import BOARD, NOISE_PX, left_from_right, lidar_from, places, rig_of, settings, views_of
from scipy.stats import chi2

from card.calibration.camera_estimate import estimate_cameras
from card.calibration.lidar_estimate import estimate_front_lidar
from card.calibration.lidar_start import Drawn
from card.calibration.robust_least_squares import Solution
from card.calibration.state import CORRECTIONS, INTRINSICS, LIDAR, STEREO, intrinsics_of, step_between
from card.simulation.board_observations import observe
from card.simulation.drawing import drawing
from card.simulation.rig import Rig

#: Within the accuracy of 1 cm that the maker states.
BIAS_M = 0.01
DRAWN = Drawn.of(drawing("full"))


@dataclass(frozen=True)
class Estimated:
    """One session's estimates and its truth."""

    rig: Rig
    cameras: Solution
    joint: Solution

    def stereo(self, solution: Solution) -> np.ndarray:
        return step_between(solution.state.left_from_right, left_from_right(self.rig))

    def lidar(self) -> np.ndarray:
        return step_between(self.joint.state.lidar_from_left, lidar_from(self.rig, "camera_left"))

    def corrections(self) -> np.ndarray:
        true = self.rig.lidar_corrections["lidar_front"]
        values = [true.channel_range_offset_m, true.channel_elevation_offset_rad]
        values = [[true.range_offset_m], *values, true.channel_azimuth_offset_rad]
        return np.concatenate(values) - self.joint.state.corrections


def estimated(seed: int, poses: np.ndarray, rig: Rig, columns: int, **lidar_settings: int) -> Estimated:
    rng = np.random.default_rng([seed, 5])
    observed = observe(rig, poses, noise_px=NOISE_PX, columns=columns, rng=rng)
    views = views_of(observed, rig)
    cameras = estimate_cameras(views, BOARD, settings()["cameras"], "here").solution
    stated = settings(**lidar_settings)["front_lidar"] | {"corner_sigma_px": NOISE_PX}
    found = estimate_front_lidar(views, observed.bursts, cameras.state, BOARD, DRAWN, stated, "here")
    return Estimated(rig, cameras, found.solution)


def biased(seed: int) -> Rig:
    """The car of a seed, its front LiDAR 1 cm off, one way or the other."""
    rig = rig_of(seed)
    corrections = rig.lidar_corrections["lidar_front"]
    bias = BIAS_M if seed % 2 else -BIAS_M
    off = type(corrections)(bias, *list(vars(corrections).values())[1:])
    return Rig(**{**vars(rig), "lidar_corrections": {**rig.lidar_corrections, "lidar_front": off}})


def mean_errors_squared(seeds: int, count: int, columns: int) -> dict[str, tuple[float, int]]:
    """Mean normalised error squared of each estimate over seeds, and its degrees of freedom a seed."""
    sums: dict[str, list[float]] = {}
    freedom = {}
    for seed in range(1, seeds + 1):
        one = estimated(seed, places(1, count), rig_of(seed), columns, starts=2, max_returns=100)
        intrinsics = intrinsics_of(one.rig.cameras["camera_left"])
        for name, error, solution, part in (
            ("stereo of the cameras alone", one.stereo(one.cameras), one.cameras, STEREO),
            ("left intrinsics", intrinsics - one.joint.state.intrinsics[0], one.joint, INTRINSICS[0]),
            ("stereo", one.stereo(one.joint), one.joint, STEREO),
            ("front LiDAR", one.lidar(), one.joint, LIDAR),
            ("corrections", one.corrections(), one.joint, CORRECTIONS),
        ):
            square = float(error @ np.linalg.solve(solution.covariance[part, part], error))
            sums.setdefault(name, []).append(square / len(error))
            freedom[name] = len(error)
    return {name: (float(np.mean(values)), freedom[name]) for name, values in sums.items()}


def check_consistent(found: dict[str, tuple[float, int]], seeds: int) -> None:
    for name, (mean, freedom) in found.items():
        low, high = chi2.ppf((0.025, 0.975), seeds * freedom) / (seeds * freedom)
        print(f"{name}: mean normalised error squared {mean:.3f}, 95 % interval {low:.3f} to {high:.3f}")
        assert low <= mean <= high, name


def test_covariances_neither_boast_nor_hide() -> None:
    check_consistent(mean_errors_squared(8, 24, 200), 8)


@pytest.mark.slow
def test_covariances_neither_boast_nor_hide_over_a_hundred_seeds() -> None:
    check_consistent(mean_errors_squared(100, 40, 400), 100)


def check_exact(seeds: range, count: int, columns: int) -> None:
    errors = []
    for seed in seeds:
        one = estimated(seed, places(seed, count), biased(seed), columns)
        for step in (one.stereo(one.cameras), one.lidar()):
            errors += [np.degrees(np.linalg.norm(step[3:])), 1e3 * np.linalg.norm(step[:3])]
    rows = np.reshape(errors, (len(seeds), 4))
    median, p95 = np.median(rows, axis=0), np.percentile(rows, 95, axis=0)
    print(f"{count} boards: stereo deg, mm, camera-LiDAR deg, mm: median {median}, p95 {p95}")
    assert (median <= (0.005, 0.5, 0.03, 3.0)).all()


def test_a_session_of_150_boards_is_exact() -> None:
    check_exact(range(1, 2), 150, 200)


@pytest.mark.slow
def test_sessions_of_150_boards_are_exact_over_five_seeds() -> None:
    check_exact(range(1, 6), 150, 2000)
