"""The report page of a small made-up release: what it shows, what it may not do, and its bytes."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from schema_rows import columns

from card.artifacts import write_arrays, write_json, write_report, write_table
from card.geometry import CameraModel, Trajectory, apply, from_json, inverse, transform
from card.report import page
from card.simulation.calibrations import true_calibration

CALIBRATION = true_calibration("2026-04-14-start", 0, "tiny")
CAMERA = CameraModel.from_json(CALIBRATION["cameras"]["camera_left"])
RIG_HEIGHT_M = -float(np.mean([wheel["contact_m"][2] for wheel in CALIBRATION["wheels"].values()]))
GATE = {"unit": "m", "better": "lower", "threshold": 0.01, "value": 0.02}


def stage(**more: Any) -> dict[str, Any]:
    blank = {"counts": {}, "figures": [], "gates": [], "notes": [], "settings": {}, "versions": {}}
    return blank | more


FULL = {
    "calibration": stage(
        figures=[{"name": "reprojection", "value": 0.12, "unit": "px", "description": "of <stereo>"}],
        gates=[
            {"figure": "reprojection", "unit": "px", "better": "lower", "threshold": 0.5, "value": 0.12}
            | {"verdict": "pass"}
        ],
    ),
    "ingest": stage(notes=["The clock jumps once."]),
    "poses": stage(gates=[GATE | {"figure": "drift", "verdict": "fail"}]),
    "ground_truth": stage(
        gates=[GATE | {"figure": "rms", "verdict": "overridden", "signed_by": "A. B.", "reason": "rain"}]
    ),
    "wheels": stage(),
    "privacy": stage(),
    "annotations": stage(),
}


def write_quality(folder: Path, stages: dict[str, Any]) -> None:
    document = {"schema": "quality", "sequence": folder.name, "stages": stages}
    write_json(folder / "package" / "sidecars" / "quality.json", document, "quality")


def write_sequence(folder: Path, stages: dict[str, Any]) -> None:
    """A drive of 60 m over a flat road with one bump of 8 cm at 30 m, with walls to both sides."""
    write_quality(folder, stages)
    t_ns = np.arange(0, 6_000_000_000, 10_000_000)
    y = np.linspace(0, 60, t_ns.size)
    track = np.stack([4 * np.sin(y / 20), y, np.full(y.size, RIG_HEIGHT_M)], axis=1)
    poses = Trajectory(t_ns, track, np.tile([1.0, 0, 0, 0], (t_ns.size, 1)))
    write_table(folder / "trajectory.parquet", poses.to_table(), "trajectory")
    write_json(folder / "calibration.json", CALIBRATION, "calibration")

    frames = [{"frame": n, "t_ns": 2_000_000_000 + n * 100_000_000} for n in range(3)]
    write_table(folder / "frames.parquet", columns("frames", frames), "frames")
    rows = [
        {**frame, "points_saved": 1000 * (2 + frame["frame"]), "points_window": 90_000, "front_share": 0.9}
        for frame in frames
    ]
    write_table(
        folder / "ground_truth" / "coverage.parquet",
        columns("coverage", [{k: v for k, v in row.items() if k != "t_ns"} for row in rows]),
        "coverage",
    )
    road = {"normal_z": 1.0, "offset_m": RIG_HEIGHT_M, "z": RIG_HEIGHT_M, "qw": 1.0, "valid": True}
    road |= dict.fromkeys(("normal_x", "normal_y", "x", "y", "qx", "qy", "qz"), 0.0)
    write_table(
        folder / "road_planes.parquet", columns("road_planes", [row | road for row in frames]), "road_planes"
    )

    gx, gy = np.meshgrid(np.arange(-6, 6, 0.05), np.arange(3, 40, 0.05))
    z = 0.08 * np.exp(-((gy - 12) ** 2)) - RIG_HEIGHT_M
    rig = np.stack([gx, gy, z], axis=-1).reshape(-1, 3)
    points = apply(inverse(from_json(CALIBRATION["extrinsics"]["rig_from_camera_left"])), rig)
    for frame in frames:
        path = folder / "ground_truth" / f"{frame['frame']:06d}.npz"
        write_arrays(path, {"points": points.astype(np.float32)}, "ground_truth_points")
        picture = folder / "anonymized" / "camera_left" / f"{frame['t_ns']}.jpg"
        picture.parent.mkdir(parents=True, exist_ok=True)
        ramp = np.linspace(60, 220, CAMERA.height)[:, None, None] * np.ones((1, CAMERA.width, 3))
        Image.fromarray(ramp.astype(np.uint8)).save(picture)

    road_cells = np.stack(np.meshgrid(np.arange(-60, 60), np.arange(0, 600), [0]), axis=-1).reshape(-1, 3)
    walls = np.stack(np.meshgrid([-61, 61], np.arange(0, 600), np.arange(0, 40)), axis=-1).reshape(-1, 3)
    ids = np.unique(np.concatenate([road_cells, walls]), axis=0).astype(np.int32)
    voxels = {
        "origin": np.zeros(3),
        "voxel_size": np.float64(0.1),
        "ids": ids,
        "counts": np.ones(len(ids), dtype=np.int32),
    }
    write_arrays(folder / "ground_truth" / "static_voxels.npz", voxels, "static_voxels")

    wheels = {}
    for name, wheel in CALIBRATION["wheels"].items():
        contact = apply(transform([0, 0, 0]), track + wheel["contact_m"])
        contact[:, 2] = 0.08 * np.exp(-((contact[:, 1] - 30) ** 2))
        samples = np.concatenate([t_ns[:, None], contact, poses.rotation_wxyz], axis=1)
        gap = (y > 40) & (y < 43)
        wheels[name] = {
            "samples": samples,
            "points": np.where(gap, 0, 30),
            "residual_m": [None if g else 0.004 for g in gap],
            "std_m": np.where(gap, 0.04, 0.001),
            "gap": gap,
            "uncertain": gap,
        }
    document = {"schema": "wheel_excitation", "wheels": wheels}
    write_json(folder / "wheel_excitation.json", document, "wheel_excitation")
    write_labels(folder)


def write_labels(folder: Path) -> None:
    """One box of the bump in each frame, which agrees with the ground truth, and one of nothing."""
    size = {"camera_left_width_px": CAMERA.width, "camera_left_height_px": CAMERA.height}
    write_report(folder / "ingest.report.json", stage="ingest", settings={}, inputs={}, counts=size)
    bump = {"class": "positive", "x_center": 0.5, "y_center": 0.7, "width": 0.6, "height": 0.1}
    nothing = {"class": "negative", "x_center": 0.2, "y_center": 0.9, "width": 0.05, "height": 0.1}
    boxes = [{"frame": frame} | box for frame in range(3) for box in (bump, nothing)]
    write_table(folder / "labels.parquet", columns("labels", boxes), "labels")
    judged = {"elevation_m": 0.07, "depression_m": 0.0, "distance_m": 12.0}
    found = [
        {"frame": box["frame"], "class": box["class"], **(judged if box["class"] == "positive" else {})}
        for box in boxes
    ]
    write_table(folder / "irregularities.parquet", columns("irregularities", found), "irregularities")
    track = {"class": "positive", "x": 4.0, "y": 30.0, "z": 0.0, "boxes": 3}
    write_table(
        folder / "irregularity_tracks.parquet", columns("irregularity_tracks", [track]), "irregularity_tracks"
    )
    notes = ["frame 1, x 0.200, y 0.900 (track 1): negative without depression: +0.1 cm, -0.2 cm"]
    path = folder / "irregularities.report.json"
    write_report(path, stage="irregularities", settings={}, inputs={}, counts={"boxes": 6}, notes=notes)


SHEET = {
    "place": "Town & Co",
    "country": "DE",
    "road_type": "town",
    "light": "day",
    "role": "split",
    "session": "2026-04-14-start",
}


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a full sequence and of one with a LiDAR only, and their release tree."""
    work = tmp_path_factory.mktemp("work")
    write_sequence(work / "full_drive", FULL)
    write_quality(work / "lidar_only", {"ingest": stage()})
    tree = work / "release" / "card-test"
    rows = [
        {"sequence": "full_drive", "frames": 3, "t_end_ns": 6_000_000_000, "distance_m": 1234.0},
        {"sequence": "lidar_only", "frames": 0, "t_end_ns": 1_000_000_000},
    ]
    write_table(tree / "metadata/sequences.parquet", columns("release_sequences", rows), "release_sequences")
    release = {
        "schema": "release",
        "repository": "card-test",
        "version": "0.1.0",
        "date": "2026-01-01",
        "spdx": "CC-BY-NC-4.0",
        "commercial": False,
        "sequences": ["full_drive", "lidar_only"],
        "frames": {"train": 2, "validation": 0, "test": 1, "zero_shot": 0, "unassigned": 0},
        "files": 1200,
        "bytes": 3_400_000,
        "overrides": [],
    }
    write_json(tree / "release.json", release, "release")
    return work


def build(work: Path, out: Path) -> str:
    page(
        results=work,
        sequences=[SHEET | {"id": "full_drive"}, SHEET | {"id": "lidar_only", "session": ""}],
        release=[work / "release" / "card-test"],
        out=out,
    )
    return (out / "index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def html(work: Path) -> str:
    return build(work, work / "report")


def test_the_page_asks_no_host_and_holds_its_figures(work: Path, html: str) -> None:
    assert not re.search(r"https?://|<script|<link|url\(", html)
    names = [path.name for path in sorted((work / "report" / "figures").iterdir())]
    drawn = ("density", "excitation", "labels", "map", "overlay")
    assert names == [f"full_drive-{name}.png" for name in drawn]
    assert html.count("data:image/png;base64,") == len(names)


def test_totals_and_licence(html: str) -> None:
    text = re.sub(r"<[^>]+>", " ", html)
    for wanted in ("card-test", "CC-BY-NC-4.0, non-commercial", "1.2 km", "1,200", "3.4 MB"):
        assert wanted in text, wanted


def test_every_figure_stands_beside_its_verdict(html: str) -> None:
    rows = {cells[1]: cells for row in re.findall(r"<tr.*?</tr>", html) if len(cells := split(row)) == 6}
    assert rows["reprojection of &lt;stereo&gt;"][2:] == ["0.12", "px", "≤ 0.5", "pass"]
    assert rows["drift not stated"][2:] == ["–", "m", "≤ 0.01", "fail"]
    assert rows["rms not stated"][5] == "overridden rain (A. B.)"
    assert "Gates: 1 pass, 1 fail, 1 overridden." in html
    assert "The clock jumps once." in html
    assert "negative without depression" in html


def split(row: str) -> list[str]:
    cells = re.findall(r"<td[^>]*>(.*?)</td>", row)
    return [" ".join(re.sub(r"<[^>]+>", " ", cell).split()) for cell in cells]


def test_text_of_others_is_escaped(html: str) -> None:
    assert "Town &amp; Co" in html
    assert "<stereo>" not in html


def test_same_inputs_same_bytes(work: Path, html: str) -> None:
    again = work / "again"
    assert build(work, again) == html
    for path in sorted((again / "figures").iterdir()):
        assert path.read_bytes() == (work / "report" / "figures" / path.name).read_bytes()
