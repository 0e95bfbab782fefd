"""Evaluation of full-size frames: against its plain form in numpy, and against merely reading the files."""

import io
import statistics
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from cost import cpu_s
from own_process import alone

from card.artifacts import default_settings, load_schema, write_json, write_table
from card.benchmark.evaluate import evaluate
from card.benchmark.frame_scores import SCALINGS, evaluated_pixels, frame_scores
from card.benchmark.frames import Method, SequenceViews, key, load, select
from card.geometry import CameraModel, quaternion_from_matrix
from card.packaging.reader import Release
from card.packaging.shards import Source, write_shards
from card.simulation.calibrations import true_calibration

FRAMES, DISTINCT = 64, 4
POINTS = 500_000
SEQUENCE = "drive"
SETTINGS = default_settings("benchmark")
BOXES = [(0.5, 0.7, 0.2, 0.1), (0.3, 0.8, 0.1, 0.05)]


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `numpy_ratio`, `read_rate_ratio`, `frames_per_s` and `peak_gb`."""
    tree, predictions = write_release(scratch)
    release, method = Release(tree), Method("method", predictions)
    pairs = []
    for _ in range(repeats):
        # By turns, so that a busy machine slows both down.
        read_s = _reading(release, method)
        pairs.append(_whole(tree, predictions, scratch / "out") | {"read_s": read_s})
    read_rate = statistics.median(pair["read_s"] / pair["seconds"] for pair in pairs)
    evaluate_s = statistics.median(pair["seconds"] for pair in pairs)
    figures = [
        ("numpy_ratio", _numpy_ratio(release, method, repeats), "1", 5.0, "higher"),
        ("read_rate_ratio", read_rate, "1", 0.8, "higher"),
        ("frames_per_s", FRAMES / evaluate_s, "1/s", None, "higher"),
        ("peak_gb", statistics.median(pair["peak_gb"] for pair in pairs), "GB", 1.0, "lower"),
    ]
    return [
        {"stage": "benchmark", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": better}
        for figure, value, unit, aim, better in figures
    ]


def write_release(scratch: Path) -> tuple[Path, Path]:
    """A release of so many frames that share the contents of a few, and a prediction for each."""
    tree, predictions = scratch / "release", scratch / "predictions"
    calibration = true_calibration("2026-04-14-start", 0, "full")
    camera = CameraModel.from_json(calibration["cameras"]["camera_left"])
    random = np.random.default_rng(0)
    sources = []
    (predictions / SEQUENCE).mkdir(parents=True)
    for content in range(DISTINCT):
        points, depth = _frame(camera, random)
        sources.append(Source(f"{SEQUENCE}/{content:06d}.ground_truth.npz", content, _npz(points)))
        np.savez_compressed(predictions / f"{content}.npz", depth=depth)
        for frame in range(content, FRAMES, DISTINCT):
            (predictions / SEQUENCE / f"{frame:06d}.npz").hardlink_to(predictions / f"{content}.npz")
        (predictions / f"{content}.npz").unlink()
    labels = "".join(f"{index} " + " ".join(map(str, box)) + "\n" for index, box in enumerate(BOXES))
    folder = tree / "data" / SEQUENCE
    folder.mkdir(parents=True)
    label = Source(f"{SEQUENCE}/labels.txt", 0, labels.encode())
    limits = {"max_bytes": 10**9, "numbers": FRAMES}
    packed = write_shards(sources, folder, "ground_truth", **limits)
    text = write_shards([label], folder, "labels", **limits)
    members = []
    for frame in range(FRAMES):
        for modality, member in (("ground_truth", packed[frame % DISTINCT]), ("labels", text[0])):
            where = {name: getattr(member, name) for name in ("offset", "size", "sha256")}
            named = {"file": f"{SEQUENCE}/{frame:06d}.{modality}", "modality": modality, "frame": frame}
            shard = f"data/{SEQUENCE}/{member.shard}"
            members.append(
                where | named | {"sequence": SEQUENCE, "burst": None, "shard": shard, "spdx": "CC0-1.0"}
            )
    _table(tree / "metadata/members.parquet", "release_members", members)
    listed = [
        {
            "sequence": SEQUENCE,
            "frame": frame,
            "has_ground_truth": True,
            "gt_flag": "complete",
            "split": "test",
        }
        for frame in range(FRAMES)
    ]
    _table(tree / "metadata/frames-test.parquet", "release_frames", listed)
    write_json(tree / "sequences" / SEQUENCE / "calibration.json", calibration, "calibration")
    level = dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_matrix(np.eye(3)), strict=True))
    planes = [
        {"frame": frame, "t_ns": frame, "valid": True, "z": 1.0, "normal_z": 1.0} | level
        for frame in range(FRAMES)
    ]
    _table(tree / "sequences" / SEQUENCE / "road_planes.parquet", "road_planes", planes)
    counts = dict.fromkeys(("train", "validation", "zero_shot", "unassigned"), 0) | {"test": FRAMES}
    about = {
        "schema": "release", "repository": "card-bench", "version": "0.1.0", "date": "2026-01-01",
        "spdx": "CC0-1.0", "commercial": True, "sequences": [SEQUENCE], "frames": counts,
        "files": len(members), "bytes": 0, "overrides": [],
    }  # fmt: skip
    write_json(tree / "release.json", about, "release")
    return tree, predictions


def _frame(camera: CameraModel, random: np.random.Generator) -> tuple[Any, Any]:
    """A road: points in the order of the pixels, as the ground truth has them, and a prediction."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(np.float32)
    depth = np.clip(1600 * 1.5 / np.maximum(v - 0.45 * camera.height, 1), 3, 70).astype(np.float32)
    flat = random.choice(depth.size // 2, POINTS, replace=False) + depth.size // 2
    pixels = np.sort(flat)
    rays = camera.rays(np.stack([u.ravel()[pixels], v.ravel()[pixels]], axis=1))
    points = (rays * depth.ravel()[pixels, None] * random.uniform(0.98, 1.02, (POINTS, 1))).astype(np.float32)
    return points, depth * random.uniform(0.9, 1.1, depth.shape).astype(np.float32)


def _numpy_ratio(release: Release, method: Method, repeats: int) -> float:
    """CPU time of the plain form by that of the compiled one; the files are read already."""
    views = SequenceViews(release, "original")
    view = views.of(SEQUENCE)
    selection = select(release, "test", method, ["complete"])
    frames = [
        load(release, row, selection.files[key(row)], method, view) for row in selection.rows[:DISTINCT]
    ]
    camera, limits = view.view.camera, (SETTINGS["min_depth_m"], SETTINGS["max_depth_m"])

    def score(plain: bool) -> list[Any]:
        found = []
        for frame in frames:
            pixels, truth = view.view.truth(frame.points, limits, plain)
            given = evaluated_pixels(
                view.view, pixels, truth, frame.prediction, frame.road_from_camera, plain
            )
            size = (camera.width, camera.height)
            found.append(
                frame_scores(given, [box[1:] for box in frame.boxes], size, SCALINGS, SETTINGS, plain)
            )
        return found

    for fast, plain in zip(score(False), score(True), strict=True):
        np.testing.assert_allclose(fast.full, plain.full, rtol=1e-10)
        np.testing.assert_allclose(fast.boxes, plain.boxes, rtol=1e-10)
    return cpu_s(lambda: score(True), repeats) / cpu_s(lambda: score(False), repeats)


def _reading(release: Release, method: Method) -> float:
    """Seconds to read all frames and predictions, one after the other, and do nothing with them."""
    view = SequenceViews(release, "original").of(SEQUENCE)
    start = time.perf_counter()
    selection = select(release, "test", method, ["complete"])
    for row in selection.rows:
        load(release, row, selection.files[key(row)], method, view)
    return time.perf_counter() - start


def _whole(tree: Path, predictions: Path, out: Path) -> dict[str, float]:
    """Seconds and peak of memory of a whole evaluation, in a process of its own."""
    seconds, spent = alone(_evaluate, tree, predictions, out)
    return {"seconds": seconds, "peak_gb": spent.peak_gb}


def _evaluate(tree: Path, predictions: Path, out: Path) -> float:
    for _ in range(2):  # the first one loads compiled code
        start = time.perf_counter()
        evaluate(
            release=tree,
            split="test",
            method=Method("method", predictions),
            task="depth",
            out=out,
            report=out.with_suffix(".report.json"),
            settings=SETTINGS,
        )
        seconds = time.perf_counter() - start
    return seconds


def _table(path: Path, schema: str, listed: list[dict[str, Any]]) -> None:
    """Write rows; what they do not say is blank in the way the schema allows."""
    columns = {}
    for name, field in load_schema(schema)["columns"].items():
        kinds = {"string": "x", "bool": False}
        blank = field["enum"][0] if "enum" in field else kinds.get(field["type"], field.get("minimum", 0))
        columns[name] = [row.get(name, None if field.get("nullable") else blank) for row in listed]
    write_table(path, columns, schema)


def _npz(points: Any) -> bytes:
    buffer = io.BytesIO()
    array = io.BytesIO()
    np.save(array, points)
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("points.npy", array.getvalue())
    return buffer.getvalue()
