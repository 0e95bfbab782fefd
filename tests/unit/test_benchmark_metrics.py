"""Depth and height metrics against scikit-learn, plain formulas and cases with a known answer."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import mean_absolute_error, mean_absolute_percentage_error, root_mean_squared_error

from card.artifacts import default_settings
from card.benchmark.depth_metrics import METRICS, depth_metrics, median_scale, truth_mask
from card.benchmark.frame_scores import frame_scores
from card.benchmark.height_metrics import height_metrics, heights, pixel_rays
from card.geometry import CameraModel, apply, transform

RANGE = (0.1, 80.0)
CAMERA = CameraModel(40, 30, 35.0, 36.0, 19.3, 14.8, (-0.2, 0.05, 1e-3, -1e-3, 0.0))
ROAD_FROM_CAMERA = transform([0.1, -0.3, 1.4], [math.cos(-0.9), math.sin(-0.9), 0.01, 0.02])
SETTINGS = default_settings("benchmark")


def random_depths(seed: int, size: int = 500) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0.5, 60, size)
    return truth, truth * np.exp(rng.normal(0, 0.4, size))


def by_the_book(truth: np.ndarray, prediction: np.ndarray) -> dict[str, float]:
    """The paper's formulas pixel by pixel."""
    n, ab, sq, se, lg, hits, valid = 0, 0.0, 0.0, 0.0, 0.0, [0, 0, 0], 0
    for d, raw in zip(truth.tolist(), prediction.tolist(), strict=True):
        p = min(max(raw, 0.1), 80.0)
        n += 1
        ab += abs(d - p) / d
        sq += (d - p) ** 2 / d
        se += (d - p) ** 2
        lg += (math.log(d) - math.log(p)) ** 2
        valid += 0.1 <= raw <= 80.0
        for k in range(3):
            hits[k] += max(d / p, p / d) < 1.25 ** (k + 1)
    values = (ab / n, sq / n, math.sqrt(se / n), math.sqrt(lg / n), *(hit / n for hit in hits), valid / n)
    return dict(zip(METRICS, values, strict=True))


@given(st.integers(0, 10_000))
def test_depth_metrics_equal_the_formulas(seed: int) -> None:
    truth, prediction = random_depths(seed, 60)
    assert depth_metrics(truth, prediction, *RANGE) == pytest.approx(
        by_the_book(truth, prediction), rel=1e-12
    )


def test_depth_metrics_equal_scikit_learn() -> None:
    truth, prediction = random_depths(1)
    prediction = np.clip(prediction, *RANGE)
    metrics = depth_metrics(truth, prediction, *RANGE)
    assert metrics["abs_rel"] == pytest.approx(mean_absolute_percentage_error(truth, prediction), rel=1e-12)
    assert metrics["rmse"] == pytest.approx(root_mean_squared_error(truth, prediction), rel=1e-12)
    assert metrics["rmse_log"] == pytest.approx(
        root_mean_squared_error(np.log(truth), np.log(prediction)), rel=1e-12
    )


def test_a_tenth_too_far_is_an_abs_rel_of_a_tenth() -> None:
    truth, _ = random_depths(2)
    metrics = depth_metrics(truth, 1.1 * truth, *RANGE)
    assert metrics["abs_rel"] == pytest.approx(0.1, abs=1e-15)
    assert metrics["sq_rel"] == pytest.approx(0.01 * truth.mean(), rel=1e-12)
    assert metrics["rmse_log"] == pytest.approx(math.log(1.1), rel=1e-12)
    assert [metrics[f"delta_{n}"] for n in (1, 2, 3)] == [1, 1, 1]


def test_delta_is_strict_at_its_threshold() -> None:
    truth = np.array([4.0, 4.0, 4.0])
    assert depth_metrics(truth, np.array([5.0, 3.2, 4.9]), *RANGE)["delta_1"] == pytest.approx(1 / 3)


def test_failures_count_in_full() -> None:
    truth = np.array([10.0, 10.0, 10.0, 10.0])
    metrics = depth_metrics(truth, np.array([10.0, 0.0, np.nan, 500.0]), *RANGE)
    assert metrics["rmse"] == pytest.approx(math.sqrt((9.9**2 + 9.9**2 + 70**2) / 4), rel=1e-12)
    assert metrics["valid_share"] == 0.25
    assert metrics["delta_3"] == 0.25


def test_only_the_truth_decides_what_is_evaluated() -> None:
    truth = np.array([[np.nan, 0.05, 0.1], [5.0, 80.0, 80.1]])
    assert truth_mask(truth, *RANGE).tolist() == [[False, False, True], [True, True, False]]


def test_median_scale_is_the_ratio_of_medians_and_ignores_gaps() -> None:
    truth, prediction = np.array([2.0, 4.0, 6.0, 9.0]), np.array([1.0, 2.0, 5.0, 0.0])
    assert median_scale(truth, prediction) == pytest.approx(4.0 / 2.0)
    assert median_scale(truth, np.zeros(4)) == 1.0


def test_no_pixels_give_no_numbers() -> None:
    none = np.zeros(0)
    assert all(math.isnan(value) for value in depth_metrics(none, none, *RANGE).values())
    assert all(math.isnan(value) for value in height_metrics(none, none, (0.1,)).values())


def test_heights_are_those_of_the_back_projected_points() -> None:
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 30, (CAMERA.height, CAMERA.width))
    rays = pixel_rays(CAMERA)
    points = rays * depth[..., None]
    wanted = apply(ROAD_FROM_CAMERA, points.reshape(-1, 3))[:, 2]
    assert heights(depth.ravel(), rays.reshape(-1, 3), ROAD_FROM_CAMERA) == pytest.approx(wanted, abs=1e-12)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width]
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    assert CAMERA.project(points.reshape(-1, 3)) == pytest.approx(uv, abs=1e-6)


@pytest.mark.parametrize(("shift", "within"), [(0.04, (1.0, 1.0)), (0.2, (0.0, 1.0)), (0.3, (0.0, 0.0))])
def test_a_road_seen_too_high_by_a_known_step(shift: float, within: tuple[float, float]) -> None:
    """Truth is the plane h = 0; the prediction is the plane h = shift, seen along the same rays."""
    rays = pixel_rays(CAMERA).reshape(-1, 3)
    slope, offset = rays @ ROAD_FROM_CAMERA[2, :3], ROAD_FROM_CAMERA[2, 3]
    on_road = slope < -0.05
    truth = -offset / slope[on_road]
    prediction = (shift - offset) / slope[on_road]
    metrics = height_metrics(
        heights(truth, rays[on_road], ROAD_FROM_CAMERA),
        heights(prediction, rays[on_road], ROAD_FROM_CAMERA),
        (0.1, 0.25),
    )
    assert metrics["height_abs_diff"] == pytest.approx(shift, rel=1e-9)
    assert metrics["height_rmse"] == pytest.approx(shift, rel=1e-9)
    assert (metrics["delta_10cm"], metrics["delta_25cm"]) == within


def test_height_metrics_equal_scikit_learn() -> None:
    rng = np.random.default_rng(4)
    truth = rng.normal(0, 0.5, 300)
    prediction = truth + rng.normal(0, 0.2, 300)
    metrics = height_metrics(truth, prediction, (0.1,))
    assert metrics["height_abs_diff"] == pytest.approx(mean_absolute_error(truth, prediction), rel=1e-12)
    assert metrics["height_rmse"] == pytest.approx(root_mean_squared_error(truth, prediction), rel=1e-12)


def frame(seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(2, 40, (CAMERA.height, CAMERA.width))
    truth[rng.random(truth.shape) < 0.5] = np.nan
    truth[:10, :10] = np.nan
    return truth, np.nan_to_num(truth, nan=7.0) * np.exp(rng.normal(0, 0.1, truth.shape))


def test_boxes_take_the_scale_of_their_image() -> None:
    truth, _ = frame()
    prediction = np.nan_to_num(truth, nan=1.0) / 2
    # In the box the prediction is right but for the image's scale of 2.
    box = (0.75, 0.75, 0.2, 0.2)
    scores = frame_scores(truth, prediction, CAMERA, ROAD_FROM_CAMERA, [box], SETTINGS)
    by_key = {(score.region, score.scaling): score for score in scores}
    assert by_key["full", "none"].metrics["abs_rel"] == pytest.approx(0.5)
    assert by_key["boxes", "none"].metrics["abs_rel"] == pytest.approx(0.5)
    assert by_key["full", "median"].metrics["abs_rel"] == pytest.approx(0, abs=1e-12)
    assert by_key["boxes", "median"].metrics["height_rmse"] == pytest.approx(0, abs=1e-9)
    assert 0 < by_key["boxes", "none"].pixels < by_key["full", "none"].pixels


def test_an_empty_box_scores_nothing() -> None:
    truth, prediction = frame()
    empty = (5 / 40, 5 / 30, 4 / 40, 4 / 30)
    boxes = frame_scores(truth, prediction, CAMERA, ROAD_FROM_CAMERA, [empty], SETTINGS)[1::2]
    assert [score.pixels for score in boxes] == [0, 0]
    assert all(math.isnan(value) for score in boxes for value in score.metrics.values())


def test_without_a_road_there_are_depths_but_no_heights() -> None:
    truth, prediction = frame()
    metrics = frame_scores(truth, prediction, CAMERA, None, [], SETTINGS)[0].metrics
    assert metrics["abs_rel"] > 0
    assert all(math.isnan(metrics[name]) for name in ("height_abs_diff", "height_rmse", "delta_10cm"))


@given(st.floats(0.2, 5.0))
def test_median_scaling_takes_out_any_common_factor(factor: float) -> None:
    truth, prediction = frame()
    scaled = [
        frame_scores(truth, p, CAMERA, ROAD_FROM_CAMERA, [], SETTINGS)[1].metrics
        for p in (prediction, factor * prediction)
    ]
    assert scaled[0] == pytest.approx(scaled[1], rel=1e-9)
