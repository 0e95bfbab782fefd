"""The artifacts of a drive of a few frames, as the stages would write them."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from card.artifacts import inventory, load_schema, sha256_file, write_json, write_table
from card.recording.burst import Burst
from card.recording.laz import write_burst

FRAMES = 6
START_NS = 1_776_150_000_000_000_000
STEP_NS = 100_000_000
STATES = ("boxes", "reviewed_none", "not_reviewed", "boxes", "reviewed_none", "not_reviewed")


def write_bursts(recording: Path, results: Path, times: list[int], rng: np.random.Generator) -> None:
    columns: dict[str, list[Any]] = {
        name: [] for name in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")
    }
    for lidar in ("lidar_front", "lidar_rear"):
        (recording / lidar).mkdir(parents=True)
        for number, t_ns in enumerate(times):
            burst = Burst(
                t_ns=t_ns - STEP_NS // 2,
                points=rng.normal(size=(8, 3)),
                intensity=np.arange(8, dtype=np.uint8),
                ring=np.arange(8, dtype=np.uint8),
                offset_ns=np.linspace(0, STEP_NS - 1, 8).astype(np.uint32),
            )
            file = f"{lidar}/{burst.t_ns}.laz"
            write_burst(recording / file, burst)
            cells = (lidar, number, burst.t_ns, burst.end_ns, len(burst), file)
            for name, value in zip(columns, cells, strict=True):
                columns[name].append(value)
    write_table(results / "bursts.parquet", columns, "bursts")


def write_images(recording: Path, results: Path, times: list[int], rng: np.random.Generator) -> None:
    folder = results / "anonymized"
    rows = []
    for camera in ("camera_left", "camera_right"):
        (folder / camera).mkdir(parents=True)
        (recording / camera).mkdir()
        for t_ns in times:
            buffer = io.BytesIO()
            pixels = rng.integers(0, 255, (24, 32, 3), dtype=np.uint8)
            Image.fromarray(pixels).save(buffer, "JPEG")
            file = f"{camera}/{t_ns}.jpg"
            (folder / file).write_bytes(buffer.getvalue())
            (recording / file).write_bytes(b"raw" + buffer.getvalue())
            hashes = (sha256_file(folder / file), sha256_file(recording / file))
            rows.append((camera, t_ns, file, 32, 24, 0, 0, *hashes, "test"))
    names = ("camera", "t_ns", "file", "width", "height", "redactions", "redacted_pixels", "sha256",
             "source_sha256", "detectors")  # fmt: skip
    columns = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
    write_table(folder / "images.parquet", columns, "images")
    boxes = [
        {"camera": "camera_left", "t_ns": t_ns, "frame": frame, "kind": "face", "x_min": 8, "y_min": 0,
         "x_max": 16, "y_max": 8, "score": 1.0, "source": "test", "model_sha256": ""}
        for frame, t_ns in enumerate(times)
    ]  # fmt: skip
    write_table(
        folder / "redactions.parquet", {name: [box[name] for box in boxes] for name in boxes[0]}, "redactions"
    )
    write_table(folder / "inventory.parquet", inventory(folder), "inventory")


def write_ground_truth(results: Path, rng: np.random.Generator) -> None:
    folder = results / "ground_truth"
    folder.mkdir()
    counts = [5 + frame for frame in range(FRAMES)]
    columns: dict[str, list[Any]] = {
        name: [0] * FRAMES
        for name, field in load_schema("coverage")["columns"].items()
        if field["type"] != "string"
    }
    columns |= {"frame": list(range(FRAMES)), "points_saved": counts, "flag": ["complete"] * FRAMES}
    write_table(folder / "coverage.parquet", columns, "coverage")
    for frame, count in enumerate(counts):
        points = rng.uniform((-1, -1, 3), (1, 1, 8), size=(count, 3)).astype(np.float32)
        np.savez(folder / f"{frame:06d}.npz", points=points)
    write_table(folder / "inventory.parquet", inventory(folder), "inventory")


def write_tables(recording: Path, results: Path, times: list[int]) -> None:
    numbers = list(range(FRAMES))
    frames = {
        "frame": numbers,
        "t_ns": times,
        "left_file": [f"camera_left/{t_ns}.jpg" for t_ns in times],
        "right_file": [f"camera_right/{t_ns}.jpg" for t_ns in times],
        "right_t_ns": times,
        "lidar_front_burst": numbers,
        "lidar_rear_burst": numbers,
    }
    write_table(results / "frames.parquet", frames, "frames")
    write_table(results / "label_states.parquet", {"frame": numbers, "state": list(STATES)}, "label_states")
    labels = {
        "frame": [0, 0, 3],
        "class": ["positive", "negative", "positive"],
        "x_center": [0.5, 0.25, 1 / 3],
        "y_center": [0.5, 0.75, 0.5],
        "width": [0.1, 0.2, 0.3],
        "height": [0.1, 0.1, 0.1],
    }
    write_table(results / "labels.parquet", labels, "labels")
    imu = {"t_ns": times} | {f"gyro_{axis}": [0.0] * FRAMES for axis in "xyz"}
    imu |= {f"accel_{axis}": [0.0] * FRAMES for axis in "xy"} | {"accel_z": [9.81] * FRAMES}
    write_table(recording / "imu.parquet", imu, "imu")
    planes: dict[str, list[Any]] = {"frame": numbers, "t_ns": times, "valid": [True] * FRAMES}
    ones = {"normal_z", "qw"}
    for name in (
        "normal_x",
        "normal_y",
        "normal_z",
        "offset_m",
        "residual_m",
        "x",
        "y",
        "z",
        "qw",
        "qx",
        "qy",
        "qz",
    ):
        planes[name] = [1.0 if name in ones else 0.0] * FRAMES
    write_table(results / "road_planes.parquet", planes, "road_planes")


def write_poses(results: Path, times: list[int]) -> None:
    poses = [
        {
            "kind": "image",
            "sensor": "camera_left",
            "index": index,
            "t_ns": t_ns,
            "translation_m": [0.0, 1.5 * index, 0.0],
            "rotation_wxyz": [1.0, 0.0, 0.0, 0.0],
        }
        for index, t_ns in enumerate(times)
    ]
    write_json(results / "poses.json", {"schema": "poses", "poses": poses}, "poses")
    sample = {
        "samples": [[float(times[0]), 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]],
        "points": [10],
        "residual_m": [0.001],
        "std_m": [0.001],
        "gap": [False],
        "uncertain": [False],
    }
    wheels = dict.fromkeys(("fl", "fr", "rl", "rr"), sample)
    write_json(
        results / "wheel_excitation.json",
        {"schema": "wheel_excitation", "wheels": wheels},
        "wheel_excitation",
    )
