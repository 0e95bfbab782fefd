"""Small recordings for tests: made of noise, sound in every respect a check looks at."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import default_settings, write_table
from card.recording.burst import Burst
from card.recording.description import write_description
from card.recording.ingest import ingest
from card.recording.laz import write_burst
from card.recording.paths import CAMERAS, LIDARS, SENSORS, burst_path, image_path, imu_path

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 100_000_000
FRAMES = 5


def description(sensors: tuple[str, ...] = SENSORS) -> dict[str, Any]:
    """A recording.yaml of `sensors`."""
    entries: dict[str, dict[str, Any]] = {
        name: {"model": "sample", "clock": "synchronised"} for name in sensors
    }
    for name in set(sensors) & set(LIDARS):
        entries[name]["deskewed"] = False
    fields = {"id": "sample", "rig": "rig", "day": "2026-04-14", "place": "yard", "country": "DE"}
    return {**fields, "sensors": entries}


def sheet_row(sensors: tuple[str, ...] = SENSORS) -> dict[str, Any]:
    """The row of the sheet that goes with `description`."""
    return {"id": "sample", "country": "DE", "modalities": list(sensors)}


def burst(t_ns: int, count: int = 200, seed: int = 0) -> Burst:
    """A burst of `count` random points that lasts just under 100 ms."""
    rng = np.random.default_rng([seed, t_ns])
    return Burst(
        t_ns=t_ns,
        points=np.round(rng.uniform(-50, 50, (count, 3)), 4),
        intensity=rng.integers(0, 256, count).astype(np.uint8),
        ring=rng.integers(0, 32, count).astype(np.uint8),
        offset_ns=np.linspace(0, PERIOD_NS - 50_000, count).astype(np.uint32),
    )


def jpeg(width: int = 16, height: int = 8, seed: int = 0) -> bytes:
    """A JPEG of noise."""
    from PIL import Image

    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=90)
    return buffer.getvalue()


def imu_columns(start_ns: int, end_ns: int, step_ns: int = 10_000_000) -> dict[str, Any]:
    """Columns of schema ``imu`` for a car at rest."""
    t_ns = np.arange(start_ns, end_ns + 1, step_ns)
    columns: dict[str, Any] = {
        f"{name}_{axis}": np.zeros(len(t_ns)) for name in ("gyro", "accel") for axis in "xyz"
    }
    return {"t_ns": t_ns, **columns, "accel_z": np.full(len(t_ns), 9.81)}


def write_recording(root: Path, sensors: tuple[str, ...] = SENSORS) -> Path:
    """A sound recording of FRAMES images and FRAMES + 1 bursts a sensor, 10 Hz, from START_NS on."""
    root.mkdir(parents=True)
    write_description(root, description(sensors))
    for camera in set(sensors) & set(CAMERAS):
        (root / camera).mkdir()
        for index in range(FRAMES):
            # The right camera fires 0.2 ms later.
            t_ns = START_NS + index * PERIOD_NS + (200_000 if camera == CAMERAS[1] else 0)
            image_path(root, camera, t_ns).write_bytes(jpeg(seed=index))
    for lidar in set(sensors) & set(LIDARS):
        (root / lidar).mkdir()
        for index in range(FRAMES + 1):
            # Bursts begin 30 ms before the frames.
            one = burst(START_NS - 30_000_000 + index * PERIOD_NS, seed=LIDARS.index(lidar))
            write_burst(burst_path(root, lidar, one.t_ns), one)
    if "imu" in sensors:
        span = imu_columns(START_NS - 50_000_000, START_NS + (FRAMES + 1) * PERIOD_NS)
        write_table(imu_path(root), span, "imu")
    return root


def ingest_sample(root: Path, sensors: tuple[str, ...] = SENSORS, gates: Any = (), **row: Any) -> Path:
    """Ingest the recording `root` of `write_recording`; the folder of its tables, beside it."""
    out = root.parent / "results"
    ingest(
        recording=root,
        sequence=sheet_row(sensors) | row,
        ledger=root.parent / "ledger" / "sample.tsv",
        frames=out / "frames.parquet",
        bursts=out / "bursts.parquet",
        inventory=out / "inventory.parquet",
        report=out / "ingest.report.json",
        settings=default_settings("ingest"),
        gates=gates,
    )
    return out
