"""Evaluation of a folder of predictions on a small release tree, and every way such a folder can be wrong."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from schema_rows import columns

from card.artifacts import check, default_settings, read_json, write_json, write_table
from card.benchmark import evaluate
from card.errors import CardError
from card.geometry import CameraModel, quaternion_from_matrix, rasterize
from card.packaging.shards import Source, write_shards
from card.simulation.calibrations import true_calibration

SEQUENCE = "drive"
FRAMES = (0, 3, 6)
CALIBRATION = true_calibration("2026-04-14-start", 0, "tiny")
CAMERA = CameraModel.from_json(CALIBRATION["cameras"]["camera_left"])


def cloud(frame: int) -> np.ndarray:
    """Random points (N, 3) in view, 3-40 m deep."""
    rng = np.random.default_rng(frame)
    pixels = rng.uniform(0, 139, (3000, 2))
    return (CAMERA.rays(pixels) * rng.uniform(3, 40, (3000, 1))).astype(np.float32)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three frames, the last without truth, the first with one full and one empty box; one road plane."""
    tree = tmp_path_factory.mktemp("release") / "card-test"
    folder = tree / "data" / SEQUENCE
    folder.mkdir(parents=True)
    sources = {"ground_truth": {}, "labels": {0: b"0 0.5 0.5 0.5 0.5\n1 0.99 0.99 0.001 0.001\n"}}
    for frame in FRAMES[:2]:
        buffer = io.BytesIO()
        np.savez(buffer, points=cloud(frame))
        sources["ground_truth"][frame] = buffer.getvalue()
    rows = []
    for modality, contents in sources.items():
        named = {f"{SEQUENCE}/{frame:06d}.{modality}": frame for frame in contents}
        given = [Source(name, contents[frame]) for name, frame in named.items()]
        for member in write_shards(given, folder, modality, 10**8):
            rows.append(
                {
                    "file": member.name,
                    "sequence": SEQUENCE,
                    "modality": modality,
                    "frame": named[member.name],
                    "burst": None,
                    "shard": f"data/{SEQUENCE}/{member.shard}",
                    "offset": member.offset,
                    "size": member.size,
                    "sha256": member.sha256,
                    "spdx": "CC-BY-4.0",
                }
            )
    write_table(tree / "metadata/members.parquet", columns("release_members", rows), "release_members")
    frames = [
        {"sequence": SEQUENCE, "frame": frame, "has_ground_truth": frame != 6, "split": "test"}
        for frame in FRAMES
    ]
    for split in ("train", "validation", "test", "zero_shot", "unassigned"):
        table = columns("release_frames", frames if split == "test" else [])
        write_table(tree / f"metadata/frames-{split}.parquet", table, "release_frames")
    write_json(tree / "sequences" / SEQUENCE / "calibration.json", CALIBRATION, "calibration")
    plane = {
        "frame": 0,
        "t_ns": 0,
        "normal_z": 1.0,
        "offset_m": 1.0,
        "valid": True,
        "z": 1.0,
        **dict(zip(("qw", "qx", "qy", "qz"), quaternion_from_matrix(np.eye(3)), strict=True)),
    }
    plane |= dict.fromkeys(("normal_x", "normal_y", "residual_m", "x", "y"), 0.0)
    planes = [plane, plane | {"frame": 3, "t_ns": 1, "valid": False}]
    write_table(
        tree / "sequences" / SEQUENCE / "road_planes.parquet",
        columns("road_planes", planes),
        "road_planes",
    )
    release = {
        "schema": "release",
        "repository": "card-test",
        "version": "0.1.0",
        "date": "2026-01-01",
        "spdx": "CC-BY-4.0",
        "commercial": True,
        "sequences": [SEQUENCE],
        "frames": {"train": 0, "validation": 0, "test": 3, "zero_shot": 0, "unassigned": 0},
        "files": len(rows),
        "bytes": sum(row["size"] for row in rows),
        "overrides": [],
    }
    write_json(tree / "release.json", release, "release")
    return tree


def predict(folder: Path, change=lambda truth: truth) -> Path:
    """Predictions for the frames that have truth: ``change`` of the depth map, 0 where there is none."""
    for frame in FRAMES[:2]:
        path = folder / SEQUENCE / f"{frame:06d}.npy"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.save(path, change(np.nan_to_num(rasterize(cloud(frame), CAMERA))).astype(np.float32))
    return folder


def run(tree: Path, predictions: Path, split: str = "test") -> dict[str, Any]:
    out = predictions.parent / "out.json"
    evaluate(
        release=tree,
        split=split,
        method=predictions.name,
        predictions=predictions,
        out=out,
        table=out.with_suffix(".md"),
        report=out.with_suffix(".report.json"),
        settings=default_settings("benchmark"),
    )
    return read_json(out, "evaluation")


def row(document: dict[str, Any], region: str, scaling: str) -> dict[str, Any]:
    return next(r for r in document["rows"] if (r["region"], r["scaling"]) == (region, scaling))


def test_scores_and_counts_of_a_scaled_truth(tree: Path, tmp_path: Path) -> None:
    document = run(tree, predict(tmp_path / "scaled", lambda truth: 1.1 * truth))
    full = row(document, "full", "none")
    assert full["samples"] == 2
    assert full["metrics"]["abs_rel"] == pytest.approx(0.1, abs=1e-7)
    assert full["metrics"]["valid_share"] == 1
    assert row(document, "full", "median")["metrics"]["abs_rel"] == pytest.approx(0, abs=1e-6)
    assert row(document, "boxes", "none")["metrics"]["abs_rel"] == pytest.approx(0.1, abs=1e-7)
    assert row(document, "boxes", "none")["samples"] == 1
    truths = [rasterize(cloud(frame), CAMERA) for frame in FRAMES[:2]]
    assert document["counts"] == {
        "frames": 2,
        "frames_without_truth": 1,
        "frames_without_road": 1,
        "boxes": 2,
        "empty_boxes": 1,
        "pixels": sum(int(np.isfinite(truth).sum()) for truth in truths),
    }
    report = read_json(tmp_path / "out.report.json", "report")
    assert report["counts"] == document["counts"]


def test_heights_use_the_road_plane_of_the_release(tree: Path, tmp_path: Path) -> None:
    """A road that lies level in the rig: heights err by the depth's error times the ray's rise in the rig."""
    document = run(tree, predict(tmp_path / "far", lambda truth: np.where(truth > 0, truth + 0.5, 0)))
    truth = rasterize(cloud(0), CAMERA)
    v, u = np.nonzero(np.isfinite(truth))
    q = CALIBRATION["extrinsics"]["rig_from_camera_left"]["rotation_wxyz"]
    w, x, y, z = q
    up_in_camera = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    wanted = np.abs(0.5 * CAMERA.rays(np.stack([u, v], axis=1)) @ up_in_camera)
    metrics = row(document, "full", "none")["metrics"]
    assert metrics["height_abs_diff"] == pytest.approx(wanted.mean(), rel=1e-4)
    assert metrics["delta_10cm"] == pytest.approx(np.mean(wanted < 0.1), abs=1e-3)


def test_better_predictions_rank_higher(tree: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    predicted = {
        "scaled": lambda truth: 1.02 * truth,
        "noisy": lambda truth: truth * rng.uniform(0.8, 1.2, truth.shape),
        "guess": lambda truth: np.full_like(truth, 20.0),
    }
    errors = []
    for name, change in predicted.items():
        metrics = row(run(tree, predict(tmp_path / name / "p", change)), "full", "none")["metrics"]
        errors.append([metrics["abs_rel"], metrics["rmse"], -metrics["delta_1"], metrics["height_rmse"]])
    assert (np.diff(np.array(errors)[:, [0, 1, 3]], axis=0) > 0).all()
    assert (np.diff(np.array(errors)[:, 2]) >= 0).all()


def test_the_table_says_what_it_is_over(tree: Path, tmp_path: Path) -> None:
    run(tree, predict(tmp_path / "scaled", lambda truth: 1.1 * truth))
    text = (tmp_path / "out.md").read_text()
    assert "scaled on card-test 0.1.0, test" in text
    assert "2 boxes (1 empty" in text
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert len(lines) == 2 + 4
    assert len({line.count("|") for line in lines}) == 1


def test_same_predictions_same_bytes(tree: Path, tmp_path: Path) -> None:
    outputs = []
    for _ in range(2):
        run(tree, predict(tmp_path / "p", lambda truth: 1.1 * truth))
        outputs.append([(tmp_path / f"out{end}").read_bytes() for end in (".json", ".md", ".report.json")])
    assert outputs[0] == outputs[1]


def spoil(path: Path, index: Any, value: float) -> None:
    depth = np.load(path)
    depth[index] = value
    np.save(path, depth)


SPOILED = {
    "prediction is missing": lambda path: path.unlink(),
    "not a prediction of this split": lambda path: np.save(path.with_name("000001.npy"), np.ones((2, 2))),
    "wrong size": lambda path: np.save(path, np.ones((10, 12))),
    "infinite depth": lambda path: spoil(path, (4, 5), np.inf),
    "negative depth": lambda path: spoil(path, (4, 5), -0.5),
    "no array of floats": lambda path: np.save(path, np.ones((140, 140), dtype=np.uint16)),
    "unreadable prediction": lambda path: path.write_bytes(b"depth"),
}


@pytest.mark.parametrize("message", SPOILED)
def test_bad_predictions_are_named(tree: Path, tmp_path: Path, message: str) -> None:
    folder = predict(tmp_path / "p")
    SPOILED[message](folder / SEQUENCE / "000003.npy")
    with pytest.raises(CardError, match=message) as caught:
        run(tree, folder)
    assert "00000" in str(caught.value)
    assert not (tmp_path / "out.json").exists()


def test_unknown_split_and_missing_folder(tree: Path, tmp_path: Path) -> None:
    with pytest.raises(CardError, match="unknown split"):
        run(tree, predict(tmp_path / "p"), split="val")
    with pytest.raises(CardError, match="no folder of predictions"):
        run(tree, tmp_path / "absent")


def test_a_split_without_frames_gives_an_empty_table(tree: Path, tmp_path: Path) -> None:
    (tmp_path / "p").mkdir()
    document = run(tree, tmp_path / "p", split="train")
    check(document, "evaluation", "test")
    assert document["counts"]["frames"] == 0
    assert all(value is None for r in document["rows"] for value in r["metrics"].values())
