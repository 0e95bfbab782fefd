"""A small release tree to evaluate on: two drives with random clouds as truth, a third for odometry."""

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import laspy
import numpy as np
from PIL import Image
from schema_rows import columns

from card.artifacts import default_settings, write_json, write_table
from card.benchmark.evaluate import evaluate
from card.benchmark.frames import Method
from card.geometry import CameraModel, apply, from_json, inverse, quaternion_from_matrix, rasterize, transform
from card.packaging.shards import Source, write_shards
from card.simulation.calibrations import true_calibration

CALIBRATION = true_calibration("2026-04-14-start", 0, "tiny")
CALIBRATION["lidar_corrections"]["lidar_front"] = {
    "range_offset_m": 0.03,
    "channel_range_offset_m": [0.0] * 32,
    "channel_elevation_offset_rad": [0.0] * 32,
    "channel_azimuth_offset_rad": [0.0] * 32,
}
CAMERAS = {
    name: CameraModel.from_json(CALIBRATION["cameras"][name]) for name in ("camera_left", "camera_right")
}
CAMERA = CAMERAS["camera_left"]
RIG_FROM = {
    name: from_json(CALIBRATION["extrinsics"][f"rig_from_{name}"]) for name in (*CAMERAS, "lidar_front")
}
#: Frames 0 and 3 of each are evaluated; 6 has no truth, 9 too little behind it.
FRAMES = (0, 3, 6, 9)
EVALUATED = [(sequence, frame) for sequence in ("drive", "night") for frame in FRAMES[:2]]
START_NS = 1_776_150_000_000_000_000
STEP_NS = 100_000_000
SWEEP = 400
BOXES = {
    ("drive", 0): b"0 0.5 0.5 0.5 0.5\n1 0.99 0.99 0.001 0.001\n",
    ("night", 3): b"1 0.3 0.7 0.3 0.4\n",
}


def cloud(sequence: str, frame: int) -> np.ndarray:
    """Random points (N, 3) in view, 3-40 m deep; the first `SWEEP` are those of the frame's own sweep."""
    rng = np.random.default_rng([ord(sequence[0]), frame])
    pixels = rng.uniform(0, 139, (3000, 2))
    return (CAMERA.rays(pixels) * rng.uniform(3, 40, (3000, 1))).astype(np.float32)


def truth(sequence: str, frame: int) -> np.ndarray:
    """Depth map (H, W); NaN for none."""
    return rasterize(cloud(sequence, frame), CAMERA)


def pose(t_ns: int) -> np.ndarray:
    """world_from_rig on a bend, 10 m/s."""
    s = (t_ns - START_NS) / 1e9
    return transform(
        [0.3 * s * s, 10 * s, 0.02 * s], [np.cos(0.05 * s), 0.01 * np.sin(s), 0.0, np.sin(0.05 * s)]
    )


def build_tree(root: Path) -> Path:
    """Write the tree."""
    tree = root / "card-test"
    rows: list[dict[str, Any]] = []
    for sequence in ("drive", "night"):
        _pack(tree, rows, sequence, "ground_truth", {f: _npz(cloud(sequence, f)) for f in (0, 3, 9)})
        _pack(tree, rows, sequence, "labels", {f: text for (s, f), text in BOXES.items() if s == sequence})
        _pack(tree, rows, sequence, "camera_left", {f: _jpg(f) for f in FRAMES})
        _pack(tree, rows, sequence, "lidar_front", {f: _sweep(sequence, f) for f in (0, 3)})
    write_table(tree / "metadata/members.parquet", columns("release_members", rows), "release_members")
    frames = [
        {
            "sequence": sequence,
            "frame": frame,
            "t_ns": START_NS + frame * STEP_NS,
            "has_ground_truth": frame != 6,
            "gt_flag": {6: None, 9: "cut"}.get(frame, "complete"),
            "has_camera_left": True,
            "has_lidar_front": frame < 6,
            "lidar_front_burst": frame,
            "place": f"{sequence} town",
            "light": "night" if sequence == "night" else "day",
            "split": "test",
        }
        for sequence in ("drive", "night")
        for frame in FRAMES
    ]
    long = [
        {"sequence": "long", "frame": f, "t_ns": START_NS + f * STEP_NS, "split": "zero_shot"}
        for f in range(400)
    ]
    for split in ("train", "validation", "test", "zero_shot", "unassigned"):
        chosen = [row for row in frames + long if row["split"] == split]
        write_table(
            tree / f"metadata/frames-{split}.parquet", columns("release_frames", chosen), "release_frames"
        )
    for sequence in ("drive", "night", "long"):
        folder = tree / "sequences" / sequence
        write_json(folder / "calibration.json", CALIBRATION, "calibration")
        write_json(
            folder / "poses.json",
            {"schema": "poses", "poses": _poses(400 if sequence == "long" else 10)},
            "poses",
        )
        write_table(folder / "road_planes.parquet", columns("road_planes", _planes()), "road_planes")
    release = {
        "schema": "release",
        "repository": "card-test",
        "version": "0.1.0",
        "date": "2026-01-01",
        "spdx": "CC-BY-4.0",
        "commercial": True,
        "sequences": ["drive", "long", "night"],
        "frames": {"train": 0, "validation": 0, "test": 8, "zero_shot": 400, "unassigned": 0},
        "files": len(rows),
        "bytes": sum(row["size"] for row in rows),
        "overrides": [],
    }
    write_json(tree / "release.json", release, "release")
    return tree


def predict(folder: Path, change: Callable[[np.ndarray], np.ndarray] = lambda depth: depth) -> Path:
    """Predictions for the evaluated frames: ``change`` of the depth map, 0 where there is none."""
    for sequence, frame in EVALUATED:
        path = folder / sequence / f"{frame:06d}.npy"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, change(np.nan_to_num(truth(sequence, frame))).astype(np.float32))
    return folder


def run(
    tree: Path, predictions: Path, split: str = "test", task: str = "depth", **changes: Any
) -> dict[str, Any]:
    """Evaluate into ``<predictions>-out``; ``space`` and ``unit_m`` are the method's, the rest settings."""
    of_method = {name: changes.pop(name) for name in ("space", "unit_m") if name in changes}
    out = predictions.with_name(f"{predictions.name}-out")
    return evaluate(
        release=tree,
        split=split,
        method=Method(predictions.name, predictions, **of_method),
        task=task,
        out=out,
        report=out.with_suffix(".report.json"),
        settings=default_settings("benchmark") | {"bootstrap_samples": 50} | changes,
    )


def row(document: Mapping[str, Any], region: str, scaling: str = "none", by: str = "all", **keys: Any) -> Any:
    """The one summary row of a case."""
    wanted = {"region": region, "scaling": scaling, "by": by} | keys
    return next(r for r in document["rows"] if all(r[name] == value for name, value in wanted.items()))


def _planes() -> list[dict[str, Any]]:
    level = dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_matrix(np.eye(3)), strict=True))
    plane = {"frame": 0, "t_ns": 0, "normal_z": 1.0, "offset_m": 1.0, "valid": True, "z": 1.0} | level
    plane |= dict.fromkeys(("normal_x", "normal_y", "residual_m", "x", "y"), 0.0)
    return [plane, plane | {"frame": 3, "t_ns": 1, "valid": False}]


def _poses(frames: int) -> list[dict[str, Any]]:
    rows = []
    for frame in range(-1, frames + 2):
        for kind, sensor, delay in (("image", "camera_left", 0), ("burst_end", "lidar_front", 40_000_000)):
            t_ns = START_NS + frame * STEP_NS + delay
            matrix = pose(t_ns)
            rows.append(
                {
                    "kind": kind,
                    "sensor": sensor,
                    "index": frame if frame >= 0 else frames + 9,
                    "t_ns": t_ns,
                    "translation_m": matrix[:3, 3].tolist(),
                    "rotation_wxyz": quaternion_from_matrix(matrix[:3, :3]).tolist(),
                }
            )
    return rows


def _pack(
    tree: Path, rows: list[dict[str, Any]], sequence: str, modality: str, contents: Mapping[int, bytes]
) -> None:
    folder = tree / "data" / sequence
    folder.mkdir(parents=True, exist_ok=True)
    named = {f"{sequence}/{number:06d}.{modality}": number for number in contents}
    given = [Source(name, number, contents[number]) for name, number in named.items()]
    burst = modality.startswith("lidar")
    for member in write_shards(given, folder, modality, max_bytes=10**8, numbers=1000) if given else ():
        number = named[member.name]
        rows.append(
            {
                "file": member.name,
                "sequence": sequence,
                "modality": modality,
                "frame": None if burst else number,
                "burst": number if burst else None,
                "shard": f"data/{sequence}/{member.shard}",
                "offset": member.offset,
                "size": member.size,
                "sha256": member.sha256,
                "spdx": "CC-BY-4.0",
            }
        )


def _npz(points: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, points=points)
    return buffer.getvalue()


def _jpg(frame: int) -> bytes:
    rng = np.random.default_rng(frame)
    buffer = io.BytesIO()
    Image.fromarray(rng.integers(0, 255, (140, 140, 3), dtype=np.uint8)).save(buffer, "JPEG")
    return buffer.getvalue()


def _sweep(sequence: str, frame: int) -> bytes:
    """The burst that sees the first `SWEEP` points of the frame's truth, each from where the car then was."""
    t_ns = START_NS + frame * STEP_NS
    seen = cloud(sequence, frame)[:SWEEP]
    offset = np.linspace(0, 90_000_000, len(seen)).astype(np.uint32)
    offset[-1] = 90_000_000
    in_world = apply(pose(t_ns) @ RIG_FROM["camera_left"], seen)
    poses = _interpolated(t_ns + 40_000_000 - 90_000_000 + offset.astype(np.int64))
    in_lidar = apply(np.array([inverse(p @ RIG_FROM["lidar_front"]) for p in poses]), in_world)
    # What the sensor measures falls short by what its corrections add.
    distance = np.linalg.norm(in_lidar, axis=1, keepdims=True)
    raw = in_lidar * (distance - 0.03) / distance
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = np.full(3, 1e-4)
    header.add_extra_dims(
        [laspy.ExtraBytesParams("ring", np.uint8), laspy.ExtraBytesParams("offset_ns", np.uint32)]
    )
    las = laspy.LasData(header)
    las.points = laspy.ScaleAwarePointRecord.zeros(len(raw), header=header)
    las.xyz, las.offset_ns = raw, offset
    buffer = io.BytesIO()
    las.write(buffer, do_compress=True)
    return buffer.getvalue()


def _interpolated(times: np.ndarray) -> np.ndarray:
    """The poses as a user of the release has them: linear between those of images and bursts' ends."""
    from card.geometry import Trajectory

    rows = sorted(_poses(10), key=lambda row: row["t_ns"])
    unique = {row["t_ns"]: row for row in rows}.values()
    path = Trajectory(*([row[name] for row in unique] for name in ("t_ns", "translation_m", "rotation_wxyz")))
    return path.at(times)
