"""The simulator: all drives at `tiny`; LiDARs and a stereo pair at the size of a real drive, on two cores."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cost import Cost, cost

from card.simulation.drives import DRIVES
from card.simulation.record import write_photographs, write_sweeps
from card.simulation.simulate import simulate_drive
from card.simulation.world import World, build_world

DRIVE = "de_town_bumps"
SEED = 1
CORES = 2
SECONDS, A_MINUTE, PAIRS = 10.0, 60.0, 8


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `tiny_s`, `lidar_s_per_min` and `stereo_pair_s`: wall seconds on two cores, and CPU-seconds."""

    def tiny() -> None:
        for drive in DRIVES:
            with TemporaryDirectory(dir=scratch) as root:
                raw, truth = Path(root, "raw"), Path(root, "truth")
                simulate_drive(drive, recording=raw, truth=truth, scale="tiny", seed=SEED, threads=CORES)

    world = build_world(DRIVE, "full", SEED)
    minute = _further(write_sweeps, _lasting(world, 1.0), _lasting(world, 1.0 + SECONDS), scratch, repeats)
    pairs = _further(
        write_photographs, _photographed(world, 2), _photographed(world, 2 + PAIRS), scratch, repeats
    )
    return [
        *_rows("tiny_s", cost(tiny, repeats), 1.0, 30),
        *_rows("lidar_s_per_min", minute, A_MINUTE / SECONDS, 90),
        *_rows("stereo_pair_s", pairs, 1 / PAIRS, 2),
    ]


def _further(write: Callable[..., None], short: World, long: World, scratch: Path, repeats: int) -> Cost:
    """What the longer drive costs more, files and truth included: scenes are set up once a drive."""

    def run(world: World) -> None:
        with TemporaryDirectory(dir=scratch) as root:
            raw, truth = Path(root, "raw"), Path(root, "truth")
            raw.mkdir()
            truth.mkdir()
            write(world, raw, truth, threads=CORES)

    first, whole = (cost(lambda world=world: run(world), repeats) for world in (short, long))  # type: ignore[misc]
    return Cost(whole.wall_s - first.wall_s, whole.cpu_s - first.cpu_s)


def _lasting(world: World, seconds: float) -> World:
    return replace(world, scale=replace(world.scale, duration_s=seconds))


def _photographed(world: World, pairs: int) -> World:
    return replace(world, scale=replace(world.scale, camera_duration_s=pairs / 10))


def _rows(figure: str, spent: Cost, factor: float, aim: float) -> list[dict[str, Any]]:
    """The figure in wall seconds on two cores; the same in CPU-seconds, which has no aim of its own."""
    row = {"stage": "simulation", "better": "lower"}
    return [
        {**row, "figure": figure, "value": spent.wall_s * factor, "unit": f"s on {CORES} cores", "aim": aim},
        {**row, "figure": f"{figure}_cpu", "value": spent.cpu_s * factor, "unit": "CPU-s", "aim": None},
    ]
