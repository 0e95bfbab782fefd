"""What a calibration session of 500 stereo pairs at full size takes on two cores, step by step.

    python benchmarks/session_time.py --pairs 500 --views 500

simulates and searches so many pairs, and estimates over so many views; fewer are scaled up to 500.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from board_sessions import DAY, NOISE_PX, places, rig_of
from cost import cost
from rows import Row, publish

from card.artifacts import default_settings, write_json
from card.calibration.cameras import calibrate_cameras
from card.calibration.detect_boards import detect_boards
from card.calibration.front_lidar import calibrate_front_lidar
from card.simulation.board_images import BoardCameras, write_board_yaml
from card.simulation.board_observations import observe, write_observations
from card.simulation.board_scene import board_quads, surroundings
from card.simulation.drawing import drawing

OUT = Path(__file__).resolve().parent / "out"
SESSION, CORES = 500, 2
AIM_S = 300.0
COLUMNS = 2000


def rows(scratch: Path, pairs: int, views: int) -> list[Row]:
    """Row `session_s`, seconds on two cores, and each step's share of it in percent."""
    steps = session_seconds(scratch, pairs, views)
    whole = sum(steps.values())
    shares = [_row(f"{name}_share_pct", 100 * part / whole, "%", None) for name, part in steps.items()]
    return [_row("session_s", whole, "s", AIM_S), *shares]


def session_seconds(scratch: Path, pairs: int, views: int) -> dict[str, float]:
    """Seconds of each step for a session; the search is shared out to both cores, the estimates are not."""
    photographs(scratch / "images", pairs)
    rig, poses = rig_of(1), places(1, views)
    observed = observe(rig, poses, noise_px=NOISE_PX, columns=COLUMNS, rng=np.random.default_rng(1))
    session = scratch / "session"
    write_observations(observed, rig, session=session, boards=scratch / "boards.parquet")
    write_board_yaml(session)
    write_json(scratch / "drawing.json", drawing("full"), "drawing")
    common: dict[str, Any] = {"settings": default_settings("calibration"), "gates": []}
    estimate: dict[str, Any] = common | {
        "board": session / "board.yaml",
        "boards": scratch / "boards.parquet",
        "cameras": scratch / "cameras.json",
    }
    work: dict[str, tuple[Callable[[], None], float]] = {
        "detection": (
            lambda: detect_boards(
                session=scratch / "images",
                boards=scratch / "found.parquet",
                report=scratch / "found.report.json",
                threads=CORES,
                **common,
            ),
            SESSION / pairs / CORES,
        ),
        "cameras": (
            lambda: calibrate_cameras(report=scratch / "cameras.report.json", **estimate),
            SESSION / views,
        ),
        "front_lidar": (
            lambda: calibrate_front_lidar(
                session=session,
                drawing=scratch / "drawing.json",
                front_lidar=scratch / "front_lidar.json",
                report=scratch / "front_lidar.report.json",
                **estimate,
            ),
            SESSION / views,
        ),
    }
    return {name: scale * cost(step, 1).cpu_s for name, (step, scale) in work.items()}


def photographs(folder: Path, pairs: int) -> None:
    """A session's images alone."""
    folder.mkdir()
    write_board_yaml(folder)
    rng = np.random.default_rng(1)
    cameras = BoardCameras(rig_of(1), surroundings(rng))
    first = int(np.datetime64(DAY, "ns").astype(np.int64))
    for number, pose in enumerate(places(1, pairs)):
        cameras.photograph(folder, board_quads(pose), first + number * 10**9, rng)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=SESSION)
    parser.add_argument("--views", type=int, default=SESSION)
    options = parser.parse_args()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="card-session-") as scratch:
        publish(rows(Path(scratch), options.pairs, options.views), OUT / "session-time.json")
    print(f"{time.perf_counter() - started:.0f} s with the simulation")


def _row(figure: str, value: float, unit: str, aim: float | None) -> Row:
    return {
        "stage": "calibration",
        "figure": figure,
        "value": value,
        "unit": unit,
        "aim": aim,
        "better": "lower",
    }


if __name__ == "__main__":
    main()
