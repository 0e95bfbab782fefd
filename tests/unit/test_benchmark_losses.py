"""Errors for training code are those of the evaluation."""

import numpy as np
import pytest
from benchmark_release import CAMERA, EVALUATED, RIG_FROM, build_tree, predict, row, run, truth

from card.benchmark.losses import height_l1, height_slope, metric_l1, to_metric
from card.geometry import CameraModel, apply, transform

ROAD = transform(
    [0.1, -0.3, 1.4], np.array([0.62, -0.78, 0.01, 0.02]) / np.linalg.norm([0.62, -0.78, 0.01, 0.02])
)


def test_the_losses_equal_the_evaluation(tmp_path) -> None:
    tree = build_tree(tmp_path / "release")
    folder = predict(tmp_path / "p", lambda depth: 1.1 * depth + 0.3)
    document = run(tree, folder)
    level = transform([0, 0, 1]) @ RIG_FROM["camera_left"]
    slope = height_slope(CAMERA, level)
    predicted = {f: np.load(folder / f[0] / f"{f[1]:06d}.npy") for f in EVALUATED}
    depth = np.mean([metric_l1(predicted[f], truth(*f)) for f in EVALUATED])
    assert row(document, "full")["metrics"]["mae"] == pytest.approx(depth, rel=1e-9)
    height = np.mean([height_l1(predicted[f], truth(*f), slope) for f in EVALUATED if f[1] == 0])
    assert row(document, "full")["metrics"]["height_abs_diff"] == pytest.approx(height, rel=1e-6)
    scaled = np.mean([metric_l1(to_metric(predicted[f], truth(*f)), truth(*f)) for f in EVALUATED])
    assert row(document, "full", "median")["metrics"]["mae"] == pytest.approx(scaled, rel=1e-9)


def test_a_height_is_its_slope_times_depth() -> None:
    camera = CameraModel(12, 9, 10.0, 10.5, 5.3, 4.1, (-0.1, 0.02, 1e-3, 0.0, 0.0))
    slope = height_slope(camera, ROAD)
    depth = np.random.default_rng(0).uniform(2, 30, slope.shape)
    v, u = np.mgrid[:9, :12]
    points = camera.rays(np.stack([u, v], axis=-1)) * depth[..., None]
    heights = apply(ROAD, points.reshape(-1, 3))[:, 2].reshape(slope.shape)
    np.testing.assert_allclose(slope * depth + ROAD[2, 3], heights, atol=1e-12)
    assert height_l1(depth + 1, depth, slope) == pytest.approx(np.mean(np.abs(slope)))


def test_pixels_without_truth_do_not_count() -> None:
    truth = np.array([[2.0, np.nan], [0.0, 4.0]])
    prediction = np.array([[1.0, 50.0], [60.0, 3.0]])
    assert metric_l1(prediction, truth) == pytest.approx(1.0)
    assert np.isnan(metric_l1(prediction, np.zeros((2, 2))))
    np.testing.assert_allclose(to_metric(prediction, truth), 1.5 * prediction)
