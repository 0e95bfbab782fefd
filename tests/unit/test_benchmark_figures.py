"""Figures of a comparison: they are drawn, they show what they say, the same bytes each time."""

from pathlib import Path

import numpy as np
import pytest
from benchmark_release import BOXES, CAMERA, build_tree, predict, run, truth
from PIL import Image

from card.artifacts import default_settings, read_table
from card.benchmark.figures import draw_figures
from card.benchmark.frames import Method, SequenceViews, load
from card.benchmark.pictures import crop_of, largest_boxes, predicted_maps, truth_maps
from card.packaging.reader import Release


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    work = tmp_path_factory.mktemp("figures")
    tree = build_tree(work)
    for name, factor in (("near", 0.9), ("far", 1.3)):
        run(tree, predict(work / name, lambda depth, factor=factor: factor * depth + 0.1 * (depth > 9)))
    return work


def draw(work: Path, out: str) -> Path:
    methods = [Method(name, work / name) for name in ("near", "far")]
    evaluations = [work / f"{name}-out" for name in ("near", "far")]
    release = work / "card-test"
    draw_figures(release=release, split="test", methods=methods, evaluations=evaluations, out=work / out)
    return work / out


def test_figures_are_drawn_and_repeat(work: Path) -> None:
    first, second = draw(work, "a"), draw(work, "b")
    names = sorted(path.name for path in first.iterdir())
    # The box of the negative class lies on a frame without a road plane: it has no heights to show.
    assert names == ["distance.png", "heights-positive.png", "sheet-positive.png"]
    for name in names:
        assert (first / name).read_bytes() == (second / name).read_bytes()
        with Image.open(first / name) as image:
            colors = np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0)
        assert image.width > 600
        assert len(colors) > 50


def test_the_box_with_the_most_truth_is_shown(work: Path) -> None:
    rows = read_table(work / "near-out" / "boxes.parquet", "evaluation_boxes").to_pylist()
    chosen = largest_boxes(rows)
    assert set(chosen) == {"positive"}
    assert (chosen["positive"]["sequence"], chosen["positive"]["frame"], chosen["positive"]["box"]) == (
        "drive",
        0,
        0,
    )


def test_maps_show_truth_and_the_scaled_prediction(work: Path) -> None:
    settings = default_settings("benchmark")
    release, method = Release(work / "card-test"), Method("far", work / "far")
    view = SequenceViews(release, "original").of("drive")
    row = release.frames("test")[0]
    frame = load(release, row, work / "far" / "drive" / "000000.npy", method, view)
    box = tuple(map(float, BOXES["drive", 0].split()[1:5]))
    span = crop_of(box, CAMERA.width, CAMERA.height)
    assert span == (slice(0, 140), slice(0, 140))
    shown, predicted = (
        truth_maps(frame, view, span, settings),
        predicted_maps(frame, view, span, settings, scaled=True),
    )
    wanted = truth("drive", 0)[span]
    np.testing.assert_array_equal(np.isfinite(shown.depth), np.isfinite(wanted))
    np.testing.assert_allclose(shown.depth[np.isfinite(wanted)], wanted[np.isfinite(wanted)])
    both = np.isfinite(shown.depth) & np.isfinite(predicted.depth)
    assert np.median(predicted.depth[both] / shown.depth[both]) == pytest.approx(1, abs=0.01)
    # Along one ray height changes with depth at the rate of the ray's slope.
    v, u = np.argwhere(both)[7]
    ray = CAMERA.rays([[u + span[1].start, v + span[0].start]])[0]
    slope = ray @ release.road("drive", 0)[2, :3]
    change = predicted.height[v, u] - shown.height[v, u]
    assert change == pytest.approx(slope * (predicted.depth[v, u] - shown.depth[v, u]), abs=1e-9)
