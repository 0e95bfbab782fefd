"""Both stages of the poses at the size of a real drive, and their memory over ten minutes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from cost import cpu_s
from field import field_drive
from own_process import alone

from card.artifacts import default_settings, read_table
from card.poses.estimate_odometry import estimate_odometry
from card.poses.pose_graph import refine_odometry
from card.recording.ingest.bursts import check_bursts
from card.recording.paths import list_bursts

DRIVE, SEED, SECONDS = "it_town_revisit", 1, 60.0  # two rounds of 220 m
LIDAR = "lidar_front"
#: The drive of ten minutes has a tenth of the columns: what grows with it are the nodes and the map.
LONG_S, LONG_COLUMNS = 600.0, 200


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `scan_ms` and `batch_s_per_min` in CPU time, reading included, and `peak_gb_10min`."""
    folder = field_drive(DRIVE, SEED, SECONDS).folder
    write_bursts_table(folder, scratch)
    odometry(folder, scratch)  # compiles
    scan_ms = 1e3 * cpu_s(lambda: odometry(folder, scratch), repeats) / (10 * SECONDS)
    batch_s = cpu_s(lambda: batch(folder, scratch), repeats) * 60 / SECONDS
    return [
        _row("scan_ms", scan_ms, "CPU-ms", 50),
        _row("batch_s_per_min", batch_s, "CPU-s", 30),
        _row("peak_gb_10min", peak_gb(scratch), "GB", 4),
    ]


def write_bursts_table(folder: Path, scratch: Path) -> None:
    """The table of the front LiDAR's sweeps, as ingest writes it."""
    from card.artifacts import write_table

    paths = list_bursts(folder / "recording", LIDAR)
    times = check_bursts(LIDAR, paths, 10_000)
    columns = {
        "lidar": [LIDAR] * len(paths),
        "burst": list(range(len(paths))),
        "t_start_ns": times.start_ns,
        "t_end_ns": times.end_ns,
        "points": times.points,
        "file": [f"{LIDAR}/{path.name}" for path in paths],
    }
    write_table(scratch / "bursts.parquet", columns, "bursts")


def odometry(
    folder: Path, scratch: Path, bursts: Path | None = None, calibration: Path | None = None
) -> None:
    """Stage 1 of a drive; `bursts`: its table if not in `scratch`; `calibration`: if not its own."""
    estimate_odometry(
        **_shared(folder, scratch, bursts, calibration),
        report=scratch / "odometry.report.json",
        settings=default_settings("odometry"),
    )


def batch(folder: Path, scratch: Path, bursts: Path | None = None, calibration: Path | None = None) -> None:
    """Stage 2 of a drive; `bursts` and `calibration` as in `odometry`."""
    refine_odometry(
        **_shared(folder, scratch, bursts, calibration),
        trajectory=scratch / "trajectory.parquet",
        nodes=scratch / "nodes.parquet",
        loops=scratch / "loops.parquet",
        g2o=scratch / "graph.g2o",
        report=scratch / "pose_graph.report.json",
        settings=default_settings("pose_graph"),
        odometry_settings=default_settings("odometry"),
    )


def _shared(folder: Path, scratch: Path, bursts: Path | None, calibration: Path | None) -> dict[str, Any]:
    return {
        "recording": folder / "recording",
        "calibration": calibration or folder / "calibration.json",
        "bursts": bursts or scratch / "bursts.parquet",
        "odometry": scratch / "odometry.parquet",
        "gates": [],
    }


def peak_gb(scratch: Path, seconds: float = LONG_S) -> float:
    """Greatest memory of a process that takes a drive of many rounds through both stages, GB."""
    alone(simulate, scratch / "long", seconds)
    return alone(_both_stages, scratch / "long", seconds)[1].peak_gb


def _both_stages(folder: Path, seconds: float) -> None:
    write_bursts_table(folder, folder)
    odometry(folder, folder)
    batch(folder, folder)
    assert read_table(folder / "nodes.parquet", "pose_graph_nodes").num_rows > 9 * seconds


def simulate(folder: Path, seconds: float) -> None:
    """The recording of a long drive and its true calibration."""
    from card.artifacts import write_json
    from card.simulation.calibrations import true_calibration
    from card.simulation.drives import drive_named
    from card.simulation.record import write_sweeps
    from card.simulation.scales import scale_named
    from card.simulation.simulate import write_description, write_motion
    from card.simulation.world import world_of

    size = replace(scale_named("full"), duration_s=seconds, columns=LONG_COLUMNS)
    world = world_of(DRIVE, drive_named(DRIVE), size, SEED)
    (folder / "recording").mkdir(parents=True)
    (folder / "truth").mkdir()
    write_motion(world, folder / "recording", folder / "truth")
    write_sweeps(world, folder / "recording", folder / "truth", 2)
    write_description(world, folder / "recording", cameras=())
    calibration = true_calibration(world.drive.session, SEED, "full")
    write_json(folder / "calibration.json", calibration, "calibration")


def _row(figure: str, value: float, unit: str, aim: float) -> dict[str, Any]:
    return {"stage": "poses", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": "lower"}
