"""The completion input, and the truth that is that very input."""

from pathlib import Path

import numpy as np
import pytest
from benchmark_release import CAMERA, EVALUATED, SWEEP, build_tree, cloud, predict, row, run, truth

from card.benchmark.completion import input_pixels, sparse_depth
from card.errors import CardError
from card.geometry import rasterize
from card.packaging.reader import Frame, Release


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("release"))


def of(release: Release, sequence: str, number: int) -> Frame:
    return next(frame for frame in release.iterate("test", sequence) if frame.number == number)


@pytest.mark.parametrize(("sequence", "frame"), EVALUATED)
def test_the_input_is_the_corrected_sweep_as_it_was_when_the_image_was_taken(tree, sequence, frame) -> None:
    release = Release(tree)
    sparse = sparse_depth(of(release, sequence, frame))
    wanted = rasterize(cloud(sequence, frame)[:SWEEP], CAMERA)
    # A point on a pixel's edge may land beside it: the sweep is stored at 0.1 mm.
    same = np.isfinite(sparse) & np.isfinite(wanted)
    assert same.sum() > 0.98 * np.isfinite(wanted).sum()
    assert np.abs(sparse[same] - wanted[same]).max() < 2e-3
    assert np.isfinite(sparse).sum() == pytest.approx(np.isfinite(wanted).sum(), abs=4)


def test_a_frame_without_a_sweep_is_told(tree: Path) -> None:
    release = Release(tree)
    with pytest.raises(CardError, match="drive, frame 6: frame has no front sweep"):
        sparse_depth(of(release, "drive", 6))


def test_truth_that_is_the_input_itself_is_known_by_place_and_depth() -> None:
    sparse = np.full((6, 8), np.nan)
    sparse[2, 3], sparse[0, 0] = 10.0, 5.0
    pixels = np.array([2 * 8 + 3, 3 * 8 + 4, 2 * 8 + 3, 2 * 8 + 5, 0, 7])
    depth = np.array([10.04, 9.96, 10.06, 10.0, 5.0, 5.0])
    found = input_pixels(pixels, depth, sparse, tolerance_m=0.05)
    # Same pixel, neighbour, same pixel at another depth, two pixels off, corner, other side of the image.
    assert found.tolist() == [True, True, False, False, True, False]


def test_a_method_that_returns_its_input_shines_only_with_the_input_in_the_truth(tree, tmp_path) -> None:
    """The input where there is one, noise elsewhere."""
    release = Release(tree)
    folder = predict(tmp_path / "copy", lambda depth: depth)
    rng = np.random.default_rng(0)
    for sequence, frame in EVALUATED:
        sparse = sparse_depth(of(release, sequence, frame))
        depth = np.where(np.isfinite(sparse), sparse, rng.uniform(3, 40, sparse.shape))
        np.save(folder / sequence / f"{frame:06d}.npy", depth)
    document = run(tree, folder, task="completion")
    everything, without = (row(document, "full", input_pixels=name) for name in ("all", "without"))
    assert everything["metrics"]["mae"] < 0.92 * without["metrics"]["mae"]
    assert everything["metrics"]["delta_1"] > without["metrics"]["delta_1"] + 0.08
    left_out = everything["truth_pixels"] - without["truth_pixels"]
    inputs = sum(np.isfinite(rasterize(cloud(*f)[:SWEEP], CAMERA)).sum() for f in EVALUATED)
    assert 0.8 * inputs < left_out < 1.05 * inputs
    assert {r["scaling"] for r in document["rows"]} == {"none"}
    noise = sum(np.isfinite(truth(*f)).sum() for f in EVALUATED)
    assert everything["truth_pixels"] == noise
    assert "the sweep's own pixels" in (tmp_path / "copy-out" / "table.md").read_text()
