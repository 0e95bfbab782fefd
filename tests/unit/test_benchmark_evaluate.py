"""Evaluation of a folder of predictions on a small release tree, and every way such a folder can be wrong."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmark_release import (
    CALIBRATION,
    CAMERA,
    CAMERAS,
    EVALUATED,
    RIG_FROM,
    build_tree,
    cloud,
    predict,
    row,
    run,
    truth,
)

from card.artifacts import check, read_json, read_table
from card.benchmark import frame_scores
from card.benchmark import truth as truth_module
from card.benchmark.pixel_metrics import METRICS
from card.cli import main
from card.errors import CardError
from card.geometry import apply, inverse, rasterize


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("release"))


def test_scores_and_counts_of_a_scaled_truth(tree: Path, tmp_path: Path) -> None:
    document = run(tree, predict(tmp_path / "scaled", lambda depth: 1.1 * depth))
    assert row(document, "full")["samples"] == 4
    assert row(document, "full")["metrics"]["abs_rel"] == pytest.approx(0.1, abs=1e-7)
    assert row(document, "full")["valid_share"] == 1
    assert row(document, "full", "median")["metrics"]["abs_rel"] == pytest.approx(0, abs=1e-6)
    assert row(document, "boxes")["metrics"]["abs_rel"] == pytest.approx(0.1, abs=1e-7)
    assert row(document, "boxes")["samples"] == 2
    assert document["counts"] == {
        "sequences": 2,
        "frames": 4,
        "frames_without_truth": 2,
        "frames_below_coverage": 2,
        "frames_without_road": 2,
        "boxes": 3,
        "empty_boxes": 1,
        "pixels": sum(int(np.isfinite(truth(*frame)).sum()) for frame in EVALUATED),
        "pixels_out_of_view": 0,
    }
    assert read_json(tmp_path / "scaled-out.report.json", "report")["counts"] == document["counts"]
    assert read_json(tmp_path / "scaled-out" / "evaluation.json", "evaluation") == document


def test_heights_use_the_road_plane_of_the_release(tree: Path, tmp_path: Path) -> None:
    """A road that lies level in the rig: heights err by the depth's error times the ray's rise in the rig."""
    document = run(tree, predict(tmp_path / "far", lambda depth: np.where(depth > 0, depth + 0.5, 0)))
    w, x, y, z = CALIBRATION["extrinsics"]["rig_from_camera_left"]["rotation_wxyz"]
    up_in_camera = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    wanted = []
    for sequence in ("drive", "night"):
        v, u = np.nonzero(np.isfinite(truth(sequence, 0)))
        wanted.append(np.abs(0.5 * CAMERA.rays(np.stack([u, v], axis=1)) @ up_in_camera))
    metrics = row(document, "full")["metrics"]
    assert metrics["height_abs_diff"] == pytest.approx(np.mean([w.mean() for w in wanted]), rel=1e-4)
    assert metrics["height_delta_1"] == pytest.approx(np.mean([np.mean(w < 0.1) for w in wanted]), abs=1e-3)


def test_the_mean_is_over_images_and_pooled_over_pixels(tree: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    folder = predict(tmp_path / "p", lambda depth: depth * rng.uniform(0.8, 1.3))
    errors = []
    for sequence, frame in EVALUATED:
        depth, wanted = np.load(folder / sequence / f"{frame:06d}.npy"), truth(sequence, frame)
        on = np.isfinite(wanted)
        errors.append((depth[on] - wanted[on]) ** 2)
    image = row(run(tree, folder), "full")
    assert image["metrics"]["rmse"] == pytest.approx(np.mean([np.sqrt(e.mean()) for e in errors]), rel=1e-9)
    pooled = row(run(tree, folder, profile="pooled"), "full")
    assert pooled["metrics"]["rmse"] == pytest.approx(np.sqrt(np.concatenate(errors).mean()), rel=1e-9)
    by_sequence = [np.mean([np.sqrt(e.mean()) for e in errors[k : k + 2]]) for k in (0, 2)]
    assert image["intervals"]["rmse"] == pytest.approx(sorted(by_sequence), rel=1e-9)
    assert row(run(tree, folder), "full", by="light", group="night")["intervals"]["rmse"] is None


def test_the_papers_profile_forgets_failures_and_says_so(tree: Path, tmp_path: Path) -> None:
    def half(depth: np.ndarray) -> np.ndarray:
        return np.where(np.arange(depth.size).reshape(depth.shape) % 2, 1.1 * depth, 0)

    folder = predict(tmp_path / "half", half)
    default, paper = (row(run(tree, folder, profile=name), "full") for name in ("default", "paper"))
    assert paper["metrics"]["abs_rel"] == pytest.approx(0.1, abs=1e-6)
    assert default["metrics"]["abs_rel"] > 0.5
    assert default["valid_share"] == paper["valid_share"] == pytest.approx(0.5, abs=0.02)
    assert default["truth_pixels"] == paper["truth_pixels"]


def test_breakdowns_add_up(tree: Path, tmp_path: Path) -> None:
    document = run(tree, predict(tmp_path / "p", lambda depth: 1.1 * depth), coverage_flags=["complete"])
    groups = {
        by: [r for r in document["rows"] if r["by"] == by] for by in ("place", "light", "distance", "class")
    }
    for by in ("place", "light", "distance"):
        full = [r for r in groups[by] if (r["region"], r["scaling"]) == ("full", "none")]
        assert sum(r["truth_pixels"] for r in full) == document["counts"]["pixels"], by
    assert {r["group"] for r in groups["light"]} == {"day", "night"}
    assert {r["group"] for r in groups["class"]} == {"positive", "negative"}
    assert row(document, "boxes", by="class", group="positive")["samples"] == 1
    near, far = (
        row(document, "full", by="distance", group=g)["metrics"]["mae"] for g in ("5-10 m", "30-40 m")
    )
    assert near < 1 < 3 < far


def test_tables_hold_a_row_a_frame_and_a_box(tree: Path, tmp_path: Path) -> None:
    run(tree, predict(tmp_path / "p", lambda depth: 1.1 * depth))
    tables = {
        name: read_table(tmp_path / "p-out" / f"{name}.parquet", f"evaluation_{name}").to_pylist()
        for name in ("frames", "boxes", "distances")
    }
    assert [len(rows) for rows in tables.values()] == [4 * 2, 3 * 2, 4 * 2 * 10]
    scaled = [r for r in tables["frames"] if r["scaling"] == "median"]
    assert [r["scale"] for r in scaled] == pytest.approx([1 / 1.1] * 4, rel=1e-6)
    empty = [r for r in tables["boxes"] if r["pixels"] == 0]
    assert len(empty) == 2
    assert all(r[name] is None for r in empty for name in (*METRICS, "distance_m"))
    assert {r["light"] for r in tables["boxes"]} == {"day", "night"}


def test_the_table_says_what_it_is_over(tree: Path, tmp_path: Path) -> None:
    run(tree, predict(tmp_path / "scaled", lambda depth: 1.1 * depth))
    text = (tmp_path / "scaled-out" / "table.md").read_text()
    assert "scaled on card-test 0.1.0, test" in text
    for part in (
        "profile `default`",
        "4 frames of 2 sequences",
        "3 boxes (1 empty",
        "Valid predictions: 100.00 %",
    ):
        assert part in text
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    assert len(tables) == 5
    assert all(len({line.count("|") for line in block.splitlines()}) == 1 for block in tables)


def test_same_predictions_same_bytes(tree: Path, tmp_path: Path) -> None:
    outputs = []
    for _ in range(2):
        run(tree, predict(tmp_path / "p", lambda depth: 1.1 * depth))
        outputs.append([path.read_bytes() for path in sorted((tmp_path / "p-out").iterdir())])
    assert len(outputs[0]) == 5
    assert outputs[0] == outputs[1]


def test_without_the_compiler_the_plain_forms_give_the_same(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a light install, which has no numba."""
    folder = predict(tmp_path / "p", lambda depth: np.sqrt(depth) * 4)
    compiled = run(tree, folder)
    for module in (truth_module, frame_scores):
        monkeypatch.setattr(module, "compiled", lambda: None)
    plain = run(tree, folder)
    assert plain["counts"] == compiled["counts"]
    for one, other in zip(plain["rows"], compiled["rows"], strict=True):
        known = {name: value for name, value in other["metrics"].items() if value is not None}
        assert {name for name, value in one["metrics"].items() if value is not None} == set(known)
        assert {name: one["metrics"][name] for name in known} == pytest.approx(known, rel=1e-10)


def test_the_command_evaluates(tree: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = predict(tmp_path / "p", lambda depth: 1.1 * depth)
    given = ["evaluate", "--release", str(tree), "--predictions", str(folder), "--out", str(tmp_path / "o")]
    (tmp_path / "settings.yaml").write_text("bootstrap_samples: 10\nmax_depth_m: 30\n")
    assert main([*given, "--profile", "pooled", "--settings", str(tmp_path / "settings.yaml")]) == 0
    assert "# p on card-test 0.1.0, test" in capsys.readouterr().out
    settings = read_json(tmp_path / "o" / "evaluation.json", "evaluation")["settings"]
    assert (settings["profile"], settings["max_depth_m"]) == ("pooled", 30)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("")
    assert main([*given[:-1], str(tmp_path / "mine")]) == 1
    assert "folder holds something else" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").exists()


def spoil(path: Path, index: Any, value: float) -> None:
    depth = np.load(path)
    depth[index] = value
    np.save(path, depth)


SPOILED = {
    "prediction is missing": lambda path: path.unlink(),
    "not a prediction of this split": lambda path: np.save(path.with_name("000001.npy"), np.ones((2, 2))),
    "prediction is there twice": lambda path: np.savez(path.with_suffix(".npz"), np.load(path)),
    "wrong size": lambda path: np.save(path, np.ones((10, 12))),
    "infinite depth": lambda path: spoil(path, (4, 5), np.inf),
    "negative depth": lambda path: spoil(path, (4, 5), -0.5),
    "negative depth .found -inf": lambda path: spoil(path, (4, 5), -np.inf),
    "is no depth map": lambda path: np.save(path, np.ones((140, 140, 3))),
    "unreadable prediction": lambda path: path.write_bytes(b"depth"),
}


@pytest.mark.parametrize("message", [m for m in SPOILED if "-inf" not in m])
def test_bad_predictions_are_named(tree: Path, tmp_path: Path, message: str) -> None:
    folder = predict(tmp_path / "p")
    SPOILED[message](folder / "night" / "000003.npy")
    with pytest.raises(CardError, match=message) as caught:
        run(tree, folder)
    assert "00000" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "p-out").exists()


def test_millimetres_taken_for_metres_are_told_by_the_median(tree: Path, tmp_path: Path) -> None:
    folder = predict(tmp_path / "p", lambda depth: 1000 * depth)
    for path in folder.rglob("*.npy"):
        np.save(path, np.load(path).round().astype(np.uint16))
    with pytest.raises(
        CardError, match=r"millimetres taken for metres .found predictions 1000 times the truth"
    ):
        run(tree, folder)
    metrics = row(run(tree, folder, unit_m=0.001), "full")["metrics"]
    assert metrics["mae"] < 0.001


def of_other(tmp_path: Path, make: Callable[[np.ndarray], np.ndarray]) -> Path:
    """Predictions made from the points of each frame."""
    folder = tmp_path / "other"
    for sequence, frame in EVALUATED:
        (folder / sequence).mkdir(parents=True, exist_ok=True)
        depth = np.nan_to_num(make(cloud(sequence, frame).astype(np.float64)))
        np.save(folder / sequence / f"{frame:06d}.npy", 1.3 * depth)
    return folder


def test_the_right_cameras_depth_is_no_prediction_for_the_left(tree: Path, tmp_path: Path) -> None:
    right_from_left = inverse(RIG_FROM["camera_right"]) @ RIG_FROM["camera_left"]
    folder = of_other(
        tmp_path, lambda points: rasterize(apply(right_from_left, points), CAMERAS["camera_right"])
    )
    with pytest.raises(CardError, match=r"wrong camera or image space .*original image of camera_right"):
        run(tree, folder)


def test_an_undeclared_image_space_is_told(tree: Path, tmp_path: Path) -> None:
    folder = of_other(tmp_path, lambda points: rasterize(points, CAMERA.undistorted()))
    with pytest.raises(CardError, match=r"wrong camera or image space .*undistorted image of camera_left"):
        run(tree, folder)
    run(tree, folder, space="undistorted")


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
