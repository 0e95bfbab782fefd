"""A drive of a few frames with all artifacts that packaging reads, written as the stages would."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
from packaging_artifacts import (
    FRAMES,
    START_NS,
    STEP_NS,
    write_bursts,
    write_ground_truth,
    write_images,
    write_poses,
    write_tables,
)

from card.artifacts import (
    Figure,
    default_settings,
    inventory,
    write_json,
    write_report,
    write_table,
)
from card.packaging.assemble import assemble
from card.packaging.licenses import read_licenses
from card.packaging.pack import pack_sequence
from card.simulation.calibrations import true_calibration

ROOT = Path(__file__).resolve().parents[2]
LICENSES = read_licenses(ROOT / "config" / "licenses.yaml")
SETTINGS = default_settings("packaging") | {"load_dataset": False}


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
    write_bursts(recording, results, times, rng)
    write_images(recording, results, times, rng)
    write_ground_truth(results, rng)
    write_tables(recording, results, times)
    write_poses(results, times)
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
    reviews: Any = {},  # noqa: B006
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
        split_report=split_report,
        takedowns=takedowns,
        reviews=reviews,
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
