"""Cameras and front LiDAR against the truth of simulated sessions, at full size but without images.

    python benchmarks/board_sessions.py --seeds 5 --boards 150 --columns 2000

simulates what is detected and scanned of so many boards, with a range bias of 1 cm, estimates, and writes
rows of the errors under benchmarks/out/; with --consistency 100 also whether sigmas tell errors over so many.
"""

import argparse
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rows import Row, publish
from scipy.stats import chi2

from card.artifacts import default_settings, progress
from card.calibration.board import Board
from card.calibration.board_views import BoardViews
from card.calibration.camera_estimate import estimate_cameras
from card.calibration.lidar_estimate import estimate_front_lidar
from card.calibration.lidar_start import Drawn
from card.calibration.robust_least_squares import Solution
from card.calibration.state import CORRECTIONS, INTRINSICS, LIDAR, STEREO, intrinsics_of, step_between
from card.geometry import inverse
from card.simulation import board
from card.simulation.board_observations import Observations, board_places, observe
from card.simulation.drawing import drawing
from card.simulation.rig import Rig, built_rig

Array = NDArray[np.float64]

OUT = Path(__file__).resolve().parent / "out"
DAY = "2026-04-14"
SIZE_PX = (2248, 2252)
#: Twice what the detector errs by on simulated images of full size.
NOISE_PX = 0.05
#: As far off as the maker lets a range be.
BIAS_M = 0.01
#: Boards and firings a revolution of the sessions that consistency is judged over.
SMALL = (24, 200)
AIMS = {"stereo_deg": 0.005, "stereo_mm": 0.5, "camera_lidar_deg": 0.03, "camera_lidar_mm": 3.0}
BOARD = Board(*board.INNER_CORNERS, board.SQUARE_M, np.array(board.SIZE_M), np.array(board.PLATE_CORNER_M))


@dataclass(frozen=True)
class Estimated:
    """The estimates of one session, of the cameras alone and joint with the LiDAR, and the car it shows."""

    rig: Rig
    cameras: Solution
    joint: Solution

    def errors(self) -> dict[str, float]:
        """Errors of the stereo pose, as the cameras alone have it, and of the LiDAR in the left camera."""
        stereo = step_between(self.cameras.state.left_from_right, left_from_right(self.rig))
        lidar = step_between(self.joint.state.lidar_from_left, lidar_from(self.rig, "camera_left"))
        return {
            f"{name}_{unit}": value
            for name, step in (("stereo", stereo), ("camera_lidar", lidar))
            for unit, value in (
                ("deg", float(np.degrees(np.linalg.norm(step[3:])))),
                ("mm", 1e3 * float(np.linalg.norm(step[:3]))),
            )
        }

    def normalised(self) -> dict[str, tuple[float, int]]:
        """Normalised error squared of each estimate, and its degrees of freedom."""
        stereo, rig = left_from_right(self.rig), self.rig
        joint, true = self.joint.state, rig.lidar_corrections["lidar_front"]
        corrections = [np.atleast_1d(values) for values in vars(true).values()]
        errors = {
            "cameras' stereo": (
                self.cameras,
                STEREO,
                step_between(self.cameras.state.left_from_right, stereo),
            ),
            "stereo": (self.joint, STEREO, step_between(joint.left_from_right, stereo)),
            "left intrinsics": (
                self.joint,
                INTRINSICS[0],
                intrinsics_of(rig.cameras["camera_left"]) - joint.intrinsics[0],
            ),
            "front LiDAR": (
                self.joint,
                LIDAR,
                step_between(joint.lidar_from_left, lidar_from(rig, "camera_left")),
            ),
            "corrections": (self.joint, CORRECTIONS, np.concatenate(corrections) - joint.corrections),
        }
        return {
            name: (float(error @ np.linalg.solve(solution.covariance[part, part], error)), len(error))
            for name, (solution, part, error) in errors.items()
        }


def estimated(seed: int, rig: Rig, poses: Array, columns: int, **front_lidar: Any) -> Estimated:
    """One session of a car before boards at poses ``rig_from_board`` (V, 4, 4).

    front_lidar : settings of that section that differ from their defaults.
    """
    rng = np.random.default_rng([seed, 5])
    observed = observe(rig, poses, noise_px=NOISE_PX, columns=columns, rng=rng)
    views, settings = views_of(observed, rig), default_settings("calibration")
    cameras = estimate_cameras(views, BOARD, settings["cameras"], "simulated session").solution
    stated = settings["front_lidar"] | {"corner_sigma_px": NOISE_PX} | front_lidar
    drawn = Drawn.of(drawing("full"))
    found = estimate_front_lidar(
        views, observed.bursts, cameras.state, BOARD, drawn, stated, "simulated session"
    )
    return Estimated(rig, cameras, found.solution)


def session_errors(seed: int, boards: int, columns: int) -> dict[str, float]:
    """Errors of a session whose front LiDAR measures 1 cm too far or too short."""
    rig = rig_of(seed)
    off = replace(rig.lidar_corrections["lidar_front"], range_offset_m=BIAS_M if seed % 2 else -BIAS_M)
    rig = replace(rig, lidar_corrections={**rig.lidar_corrections, "lidar_front": off})
    return estimated(seed, rig, places(seed, boards), columns).errors()


def normalised_errors(seeds: int, boards: int, columns: int) -> dict[str, tuple[Array, int]]:
    """Normalised errors squared (seeds,) of each estimate over cars before the same boards; its freedom."""
    found: dict[str, tuple[list[float], int]] = {}
    for seed in progress(range(1, seeds + 1), "consistency", seeds):
        one = estimated(seed, rig_of(seed), places(1, boards), columns, starts=2, max_returns=100)
        for name, (square, freedom) in one.normalised().items():
            found.setdefault(name, ([], freedom))[0].append(square)
    return {name: (np.array(squares), freedom) for name, (squares, freedom) in found.items()}


def mean_normalised(found: dict[str, tuple[Array, int]]) -> dict[str, tuple[float, float, float]]:
    """Mean normalised error squared of each estimate by its freedom, and its two-sided 95 % interval."""
    means = {}
    for name, (squares, freedom) in found.items():
        total = len(squares) * freedom
        low, high = chi2.ppf((0.025, 0.975), total) / total
        means[name] = (float(squares.mean()) / freedom, float(low), float(high))
    return means


def consistency_row(found: dict[str, tuple[Array, int]]) -> Row:
    """Share of errors inside their two-sided 95 % interval: 95 where sigmas neither boast nor hide."""
    inside = [
        (low <= squares) & (squares <= high)
        for squares, freedom in found.values()
        for low, high in [chi2.ppf((0.025, 0.975), freedom)]
    ]
    return _row("consistency_pct", 100 * float(np.mean(inside)), "%", 90.0, "higher")


@cache
def places(seed: int, count: int) -> Array:
    """Poses of the board before the car of a seed."""
    return board_places(rig_of(seed), count, np.random.default_rng([seed, 1]))


def rig_of(seed: int) -> Rig:
    """The car of a seed, with cameras of full size."""
    return built_rig(DAY, seed, *SIZE_PX)


def views_of(observed: Observations, rig: Rig) -> BoardViews:
    """The views as the detector would give them."""
    camera = rig.cameras["camera_left"]
    names = tuple(str(t_ns) for t_ns in observed.t_ns)
    return BoardViews(names, observed.t_ns, observed.pixels, (camera.width, camera.height))


def left_from_right(rig: Rig) -> Array:
    """The true stereo pose (4, 4)."""
    return inverse(rig.rig_from["camera_left"]) @ rig.rig_from["camera_right"]


def lidar_from(rig: Rig, camera: str) -> Array:
    """The true pose (4, 4) of a camera in the front LiDAR."""
    return inverse(rig.rig_from["lidar_front"]) @ rig.rig_from[camera]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--boards", type=int, default=150)
    parser.add_argument("--columns", type=int, default=2000, help="firings of the LiDAR a revolution")
    parser.add_argument("--consistency", type=int, default=0, help="seeds that the sigmas are judged over")
    options = parser.parse_args()
    seeds = progress(range(1, options.seeds + 1), "sessions", options.seeds)
    errors = [session_errors(seed, options.boards, options.columns) for seed in seeds]
    rows = []
    for figure, aim in AIMS.items():
        values, unit = [one[figure] for one in errors], figure.rsplit("_", 1)[1]
        rows.append(_row(figure, float(np.median(values)), unit, aim, "lower"))
        rows.append(_row(f"{figure}_p95", float(np.percentile(values, 95)), unit, None, "lower"))
    if options.consistency:
        found = normalised_errors(options.consistency, *SMALL)
        for name, (mean, low, high) in mean_normalised(found).items():
            print(f"{name}: mean normalised error squared {mean:.3f}, wanted {low:.3f} to {high:.3f}")
        rows.append(consistency_row(found))
    publish(rows, OUT / "board-sessions.json")


def _row(figure: str, value: float, unit: str, aim: float | None, better: str) -> Row:
    return {
        "stage": "calibration",
        "figure": figure,
        "value": value,
        "unit": unit,
        "aim": aim,
        "better": better,
    }


if __name__ == "__main__":
    main()
