"""A drive of a few frames with all artifacts that packaging reads, written as the stages would."""

import io
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from card.artifacts import (
    Figure,
    default_settings,
    inventory,
    load_schema,
    sha256_file,
    write_json,
    write_report,
    write_table,
)
from card.artifacts.schemas import schema_folder
from card.packaging.assemble import assemble
from card.packaging.licenses import read_licenses
from card.packaging.pack import pack_sequence
from card.recording.burst import Burst
from card.recording.laz import write_burst
from card.simulation.calibrations import true_calibration

ROOT = Path(__file__).resolve().parents[2]
LICENSES = read_licenses(ROOT / "config" / "licenses.yaml")
SETTINGS = default_settings("packaging") | {"load_dataset": False}
FRAMES = 6
START_NS = 1_776_150_000_000_000_000
STEP_NS = 100_000_000
STATES = ("boxes", "reviewed_none", "not_reviewed", "boxes", "reviewed_none", "not_reviewed")


def sheet_row(name: str = "de_test", **cells: Any) -> dict[str, Any]:
    """Row of the sequence sheet, as `card.recording.sheet` gives it."""
    row = {
        "id": name,
        "recording": f"recordings/{name}",
        "format": "native",
        "country": "DE",
        "place": "test-town",
        "session": "2026-04-14-start",
        "road_type": "town",
        "light": "day",
        "role": "split",
        "off_road": False,
        "modalities": ["camera_left", "camera_right", "lidar_front", "lidar_rear", "imu"],
        "quarantine": "",
    }
    return row | cells


def write_drive(work: Path, row: dict[str, Any], seed: int = 0) -> dict[str, Any]:
    """Write all artifacts of a drive under `work`; return the inputs of `pack_sequence` by name."""
    rng = np.random.default_rng(seed)
    results, recording = work / "results" / row["id"], work / "recordings" / row["id"]
    results.mkdir(parents=True)
    times = [START_NS + seed * 10**12 + i * STEP_NS for i in range(FRAMES)]
    _write_bursts(recording, results, times, rng)
    _write_images(recording, results, times, rng)
    _write_ground_truth(results, rng)
    _write_tables(recording, results, times)
    _write_poses(results, times)
    write_json(results / "calibration.json", true_calibration("2026-04-14-start", 1, "tiny"), "calibration")
    write_table(results / "inventory.parquet", inventory(recording), "inventory")
    return {
        "sequence": row,
        "spdx": LICENSES["countries"][row["country"]],
        "frames": results / "frames.parquet",
        "bursts": results / "bursts.parquet",
        "recording_inventory": results / "inventory.parquet",
        "lidar_front": recording / "lidar_front",
        "lidar_rear": recording / "lidar_rear",
        "imu": recording / "imu.parquet",
        "calibration": results / "calibration.json",
        "poses": results / "poses.json",
        "wheel_excitation": results / "wheel_excitation.json",
        "road_planes": results / "road_planes.parquet",
        "ground_truth": results / "ground_truth",
        "anonymized": results / "anonymized",
        "labels": results / "labels.parquet",
        "label_states": results / "label_states.parquet",
        "reports": {
            "wheels": write_gated_report(results / "wheels.report.json", row["id"], 0.01),
            **{
                stage: write_plain_report(results / f"{stage}.report.json", stage, row["id"])
                for stage in ("calibration", "poses", "privacy")
            },
        },
        "out": results / "package",
        "report": results / "package.report.json",
        "settings": {name: SETTINGS[name] for name in ("shard_max_bytes", "shard_frames", "classes")},
        "gates": [],
    }


def write_gated_report(path: Path, sequence: str, residual_m: float, overrides: Any = ()) -> Path:
    """Report of a stage whose residual has to stay below 2 cm."""
    write_report(
        path,
        stage="wheels",
        sequence=sequence,
        settings={},
        inputs={},
        counts={},
        figures=[Figure("residual", residual_m, "m", "Residual")],
        gates=[{"figure": "residual", "unit": "m", "better": "lower", "threshold": 0.02}],
        overrides=overrides,
    )
    return path


def write_plain_report(path: Path, stage: str, sequence: str) -> Path:
    """Report of a stage without gates."""
    write_report(path, stage=stage, sequence=sequence, settings={}, inputs={}, counts={})
    return path


def write_splits(path: Path, splits: list[str], group: str | None = "g") -> Path:
    """Table of splits, one a frame."""
    columns = {
        "frame": list(range(len(splits))),
        "split": splits,
        "group": [group] * len(splits),
        "stratum": ["positive/test-town"] * len(splits),
        "sampled": [split != "unassigned" for split in splits],
    }
    write_table(path, columns, "splits")
    return path


def build_tree(work: Path, name: str = "de_test", splits: list[str] | None = None) -> Path:
    """A tree with one packed drive."""
    inputs = write_drive(work, sheet_row(name))
    pack_sequence(**inputs)
    chosen = splits or ["train", "unassigned", "unassigned", "train", "unassigned", "unassigned"]
    table = write_splits(work / "results" / name / "splits.parquet", chosen)
    return assemble_tree(work, [{"id": name, "package": inputs["out"], "splits": table}])


def assemble_tree(
    work: Path,
    sequences: list[dict[str, Any]],
    spdx: str = "CC-BY-4.0",
    terms: Any = None,
    takedowns: Any = (),
    previous: Path | None = None,
    version: str = "0.1.0",
    split_report: Path | None = None,
) -> Path:
    """Assemble packages into a tree with the repository's own templates."""
    terms = terms or LICENSES["licenses"][spdx]
    out = work / "results" / "release" / terms["repository"]
    assemble(
        repository=terms["repository"],
        spdx=spdx,
        terms=terms,
        sequences=sequences,
        release_folder=_pages(work, version),
        schemas=schema_folder(),
        split_report=split_report,
        takedowns=takedowns,
        records=[previous] if previous else [],
        out=out,
        report=out.with_name(f"{out.name}.report.json"),
        settings=SETTINGS | {"release": SETTINGS["release"] | {"version": version}},
        gates=[],
    )
    return out


def _pages(work: Path, version: str) -> Path:
    """The repository's templates with an entry for the version in the changelog."""
    folder = Path(shutil.copytree(ROOT / "release", work / "pages", dirs_exist_ok=True))
    changelog = folder / "CHANGELOG.md"
    text = changelog.read_text()
    if f"## {version}\n" not in text:
        changelog.write_text(f"{text}\n## {version}\n\nA version.\n")
    return folder


def _write_bursts(recording: Path, results: Path, times: list[int], rng: np.random.Generator) -> None:
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


def _write_images(recording: Path, results: Path, times: list[int], rng: np.random.Generator) -> None:
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
            rows.append((camera, t_ns, file, 32, 24, 0, 0, *hashes, "test", "1"))
    names = ("camera", "t_ns", "file", "width", "height", "redactions", "redacted_pixels", "sha256",
             "source_sha256", "detector", "detector_version")  # fmt: skip
    columns = dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
    write_table(folder / "images.parquet", columns, "images")
    write_table(folder / "inventory.parquet", inventory(folder), "inventory")


def _write_ground_truth(results: Path, rng: np.random.Generator) -> None:
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


def _write_tables(recording: Path, results: Path, times: list[int]) -> None:
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


def _write_poses(results: Path, times: list[int]) -> None:
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
        "gap": [False],
    }
    wheels = dict.fromkeys(("fl", "fr", "rl", "rr"), sample)
    write_json(
        results / "wheel_excitation.json",
        {"schema": "wheel_excitation", "wheels": wheels},
        "wheel_excitation",
    )
