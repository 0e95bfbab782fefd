"""Depth, completion and height metrics against scikit-learn, plain formulas and cases with a known answer."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import mean_absolute_error, mean_absolute_percentage_error, root_mean_squared_error

from card.artifacts import default_settings
from card.benchmark import kernels, pixel_metrics
from card.benchmark.frame_scores import SCALINGS, FrameScores, evaluated_pixels, frame_scores
from card.benchmark.pixel_metrics import METRICS, SUMS, metrics_of
from card.benchmark.truth import View
from card.geometry import CameraModel, apply, transform

RANGE = (0.1, 80.0)
TAUS = (0.1, 0.25)
NO_EDGES = np.zeros(0)
CAMERA = CameraModel(40, 30, 35.0, 36.0, 19.3, 14.8, (-0.2, 0.05, 1e-3, -1e-3, 0.0))
VIEW = View(CAMERA)
ROAD_FROM_CAMERA = transform([0.1, -0.3, 1.4], [math.cos(-0.9), math.sin(-0.9), 0.01, 0.02])
SETTINGS = default_settings("benchmark")
BOTH = pytest.mark.parametrize("form", [pixel_metrics, kernels])


def random_depths(seed: int, size: int = 500) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(0.5, 60, size)
    return truth, truth * np.exp(rng.normal(0, 0.4, size))


def score(form: Any, truth: Any, prediction: Any, slope: Any = None, drop: bool = False) -> dict[str, float]:
    """Metrics of pixels (M,), one part, unscaled; and ``valid_share``."""
    d, p = np.asarray(truth, dtype=np.float64), np.asarray(prediction, dtype=np.float64)
    n = np.full(d.shape, np.nan) if slope is None else slope
    sums = form.pixel_sums(d, p, n, np.ones(1), NO_EDGES, RANGE, TAUS, drop)[0, 0]
    found = {name: float(value) for name, value in metrics_of(sums).items()}
    share = sums[SUMS.index("valid")] / sums[SUMS.index("truth")] if d.size else math.nan
    return found | {"valid_share": float(share)}


def by_the_book(truth: np.ndarray, prediction: np.ndarray, slope: np.ndarray) -> dict[str, float]:
    """The paper's formulas pixel by pixel."""
    n = len(truth)
    total = dict.fromkeys(("abs", "sq", "lg", "ar", "sr", "ia", "is", "ha", "hs"), 0.0)
    hits, within, valid = [0, 0, 0], [0, 0], 0
    for d, raw, rise in zip(truth.tolist(), prediction.tolist(), slope.tolist(), strict=True):
        p = min(max(raw, 0.1), 80.0)
        h = abs(d * rise - p * rise)
        for name, value in {
            "ar": abs(d - p) / d, "sr": (d - p) ** 2 / d, "sq": (d - p) ** 2, "abs": abs(d - p),
            "lg": (math.log(d) - math.log(p)) ** 2, "ia": abs(1 / d - 1 / p), "is": (1 / d - 1 / p) ** 2,
            "ha": h, "hs": h * h,
        }.items():  # fmt: skip
            total[name] += value
        valid += 0.1 <= raw <= 80.0
        for k in range(3):
            hits[k] += max(d / p, p / d) < 1.25 ** (k + 1)
        for k, tau in enumerate(TAUS):
            within[k] += h < tau
    return {
        "abs_rel": total["ar"] / n,
        "sq_rel": total["sr"] / n,
        "rmse": math.sqrt(total["sq"] / n),
        "rmse_log": math.sqrt(total["lg"] / n),
        **{f"delta_{k + 1}": hits[k] / n for k in range(3)},
        "mae": total["abs"] / n,
        "irmse": math.sqrt(total["is"] / n),
        "imae": total["ia"] / n,
        "height_abs_diff": total["ha"] / n,
        "height_rmse": math.sqrt(total["hs"] / n),
        **{f"height_delta_{k + 1}": within[k] / n for k in range(2)},
        "valid_share": valid / n,
    }


@BOTH
@settings(deadline=None)  # the first example compiles
@given(st.integers(0, 10_000))
def test_metrics_equal_the_formulas(form: Any, seed: int) -> None:
    truth, prediction = random_depths(seed, 60)
    slope = np.random.default_rng(seed).normal(0, 0.2, 60)
    found = score(form, truth, prediction, slope)
    assert set(found) == {*METRICS, "valid_share"}
    assert found == pytest.approx(by_the_book(truth, prediction, slope), rel=1e-12)


@BOTH
def test_metrics_equal_scikit_learn(form: Any) -> None:
    truth, prediction = random_depths(1)
    prediction = np.clip(prediction, *RANGE)
    slope = np.random.default_rng(1).normal(0, 0.2, truth.size)
    found = score(form, truth, prediction, slope)
    assert found["abs_rel"] == pytest.approx(mean_absolute_percentage_error(truth, prediction), rel=1e-12)
    assert found["rmse"] == pytest.approx(root_mean_squared_error(truth, prediction), rel=1e-12)
    assert found["mae"] == pytest.approx(mean_absolute_error(truth, prediction), rel=1e-12)
    logs = np.log(truth), np.log(prediction)
    assert found["rmse_log"] == pytest.approx(root_mean_squared_error(*logs), rel=1e-12)
    assert found["imae"] == pytest.approx(mean_absolute_error(1 / truth, 1 / prediction), rel=1e-12)
    assert found["irmse"] == pytest.approx(root_mean_squared_error(1 / truth, 1 / prediction), rel=1e-12)
    heights = truth * slope + 1.4, prediction * slope + 1.4
    assert found["height_abs_diff"] == pytest.approx(mean_absolute_error(*heights), rel=1e-12)
    assert found["height_rmse"] == pytest.approx(root_mean_squared_error(*heights), rel=1e-12)


@pytest.mark.parametrize("drop", [False, True])
@pytest.mark.parametrize("road", [True, False])
@settings(deadline=None)  # the first example compiles
@given(st.integers(0, 10_000))
def test_the_compiled_form_is_the_plain_one(road: bool, drop: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth, prediction = random_depths(seed, 200)
    prediction[rng.random(200) < 0.1] = rng.choice([0.0, np.nan, 1e-3, 500.0])
    slope = rng.normal(0, 0.2, 200) if road else np.full(200, np.nan)
    scales, edges = np.array([1.0, rng.uniform(0.3, 3)]), np.array([5.0, 20.0, 41.0])
    asked = (truth, prediction, slope, scales, edges, RANGE, TAUS, drop)
    plain, compiled = pixel_metrics.pixel_sums(*asked), kernels.pixel_sums(*asked)
    np.testing.assert_allclose(compiled, plain, rtol=1e-12, atol=1e-12)
    assert kernels.median_scale(truth, prediction) == pixel_metrics.median_scale(truth, prediction)


@BOTH
def test_a_tenth_too_far_is_an_abs_rel_of_a_tenth(form: Any) -> None:
    truth, _ = random_depths(2)
    found = score(form, truth, 1.1 * truth)
    assert found["abs_rel"] == pytest.approx(0.1, abs=1e-15)
    assert found["sq_rel"] == pytest.approx(0.01 * truth.mean(), rel=1e-12)
    assert found["rmse_log"] == pytest.approx(math.log(1.1), rel=1e-12)
    assert found["imae"] == pytest.approx((1 - 1 / 1.1) * np.mean(1 / truth), rel=1e-12)
    assert [found[f"delta_{n}"] for n in (1, 2, 3)] == [1, 1, 1]


@BOTH
def test_delta_is_strict_at_its_threshold(form: Any) -> None:
    assert score(form, [4.0, 4.0, 4.0], [5.0, 3.2, 4.9])["delta_1"] == pytest.approx(1 / 3)


@BOTH
def test_failures_count_in_full(form: Any) -> None:
    found = score(form, [10.0] * 4, [10.0, 0.0, np.nan, 500.0])
    assert found["rmse"] == pytest.approx(math.sqrt((9.9**2 + 9.9**2 + 70**2) / 4), rel=1e-12)
    assert found["valid_share"] == 0.25
    assert found["delta_3"] == 0.25


@BOTH
def test_the_papers_valid_set_leaves_failures_out(form: Any) -> None:
    found = score(form, [10.0] * 5, [11.0, 0.0, np.nan, 500.0, 0.05], drop=True)
    assert found["rmse"] == pytest.approx(1.0)
    assert found["valid_share"] == 0.2
    assert math.isnan(score(form, [10.0], [0.0], drop=True)["rmse"])


def test_only_the_truth_decides_what_is_evaluated() -> None:
    rays = VIEW.rays.reshape(30, 40, 2)[10, :6]
    depth = np.array([0.05, 0.1, 5.0, 79.0, 80.1, 30.0], dtype=np.float32)
    points = np.column_stack([rays, np.ones(6)]).astype(np.float32) * depth[:, None]
    for plain in (True, False):
        pixels, truth = VIEW.truth(points, RANGE, plain)
        assert pixels.tolist() == [401, 402, 403, 405]
        np.testing.assert_array_equal(truth, depth[[1, 2, 3, 5]].astype(np.float64))


@BOTH
def test_median_scale_is_the_ratio_of_medians_and_ignores_gaps(form: Any) -> None:
    truth, prediction = np.array([2.0, 4.0, 6.0, 9.0]), np.array([1.0, 2.0, 5.0, 0.0])
    assert form.median_scale(truth, prediction) == pytest.approx(4.0 / 2.0)
    assert form.median_scale(truth, np.array([1.0, 2.0, 5.0, 7.0])) == pytest.approx(5.0 / 3.5)
    assert form.median_scale(truth, np.zeros(4)) == 1.0


@BOTH
def test_no_pixels_give_no_numbers(form: Any) -> None:
    assert all(math.isnan(value) for value in score(form, [], []).values())


def given_frame(
    truth: np.ndarray, prediction: np.ndarray, road: Any = ROAD_FROM_CAMERA, plain: bool = False
) -> Any:
    """Evaluated pixels of depth maps (H, W)."""
    pixels = np.flatnonzero(np.isfinite(truth))
    return evaluated_pixels(VIEW, pixels, truth.ravel()[pixels], prediction, road, plain)


def scores(
    truth: np.ndarray, prediction: np.ndarray, boxes: Any = (), road: Any = ROAD_FROM_CAMERA, **changes: Any
):
    given = given_frame(truth, prediction, road)
    return frame_scores(given, boxes, (40, 30), SCALINGS, SETTINGS | changes)


def of(found: FrameScores, region: str, scaling: str, index: int = 0) -> dict[str, float]:
    s = SCALINGS.index(scaling)
    sums = found.full[s] if region == "full" else found.boxes[s, index]
    return {name: float(value) for name, value in metrics_of(sums).items()}


def test_heights_are_those_of_the_back_projected_points() -> None:
    """By the points themselves: errors of height over the plane, not of depth times a slope."""
    truth, prediction = frame()
    on = np.isfinite(truth)
    rays = np.column_stack([VIEW.rays[on.ravel()], np.ones(on.sum())])
    heights = [apply(ROAD_FROM_CAMERA, rays * depth[on][:, None])[:, 2] for depth in (truth, prediction)]
    found = of(scores(truth, prediction), "full", "none")
    assert found["height_abs_diff"] == pytest.approx(mean_absolute_error(*heights), rel=1e-9)
    assert found["height_delta_1"] == pytest.approx(np.mean(np.abs(heights[0] - heights[1]) < 0.1))


@pytest.mark.parametrize(("shift", "within"), [(0.04, (1.0, 1.0)), (0.2, (0.0, 1.0)), (0.3, (0.0, 0.0))])
def test_a_road_seen_too_high_by_a_known_step(shift: float, within: tuple[float, float]) -> None:
    """Truth is the plane h = 0; the prediction is the plane h = shift, seen along the same rays."""
    n, offset = ROAD_FROM_CAMERA[2, :3], ROAD_FROM_CAMERA[2, 3]
    slope = (VIEW.rays @ n[:2] + n[2]).reshape(30, 40)
    with np.errstate(divide="ignore"):
        truth = np.where(slope < -0.05, -offset / slope, np.nan)
        prediction = np.where(slope < -0.05, (shift - offset) / slope, 0)
    found = of(scores(truth, prediction), "full", "none")
    assert found["height_abs_diff"] == pytest.approx(shift, rel=1e-9)
    assert found["height_rmse"] == pytest.approx(shift, rel=1e-9)
    assert (found["height_delta_1"], found["height_delta_2"]) == within


def frame(seed: int = 5) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    truth = rng.uniform(2, 40, (CAMERA.height, CAMERA.width))
    truth[rng.random(truth.shape) < 0.5] = np.nan
    truth[:10, :10] = np.nan
    return truth, np.nan_to_num(truth, nan=7.0) * np.exp(rng.normal(0, 0.1, truth.shape))


def test_boxes_take_the_scale_of_their_image() -> None:
    truth, _ = frame()
    # In the box the prediction is right but for the image's scale of 2.
    found = scores(truth, np.nan_to_num(truth, nan=1.0) / 2, [(0.75, 0.75, 0.2, 0.2)])
    assert of(found, "full", "none")["abs_rel"] == pytest.approx(0.5)
    assert of(found, "boxes", "none")["abs_rel"] == pytest.approx(0.5)
    assert of(found, "full", "median")["abs_rel"] == pytest.approx(0, abs=1e-12)
    assert of(found, "boxes", "median")["height_rmse"] == pytest.approx(0, abs=1e-9)
    assert 0 < found.boxes[0, 0, 0] < found.full[0, 0]


def test_ranges_of_distance_part_the_full_image() -> None:
    truth, prediction = frame()
    found = scores(truth, prediction, distance_edges_m=[10, 25])
    np.testing.assert_allclose(found.distances.sum(axis=1), found.full)
    counts = [np.sum((truth >= a) & (truth < b)) for a, b in ((0, 10), (10, 25), (25, 81))]
    assert found.distances[0, :, 0].tolist() == counts


def test_an_empty_box_scores_nothing() -> None:
    truth, prediction = frame()
    found = scores(truth, prediction, [(5 / 40, 5 / 30, 4 / 40, 4 / 30)])
    assert math.isnan(found.box_depth[0])
    assert all(math.isnan(value) for s in SCALINGS for value in of(found, "boxes", s).values())


def test_without_a_road_there_are_depths_but_no_heights() -> None:
    truth, prediction = frame()
    found = of(scores(truth, prediction, road=None), "full", "none")
    assert found["abs_rel"] > 0
    assert all(math.isnan(found[name]) for name in METRICS if name.startswith("height"))


@settings(deadline=None)
@given(st.floats(0.2, 5.0))
def test_median_scaling_takes_out_any_common_factor(factor: float) -> None:
    truth, prediction = frame()
    scaled = [of(scores(truth, p), "full", "median") for p in (prediction, factor * prediction)]
    assert scaled[0] == pytest.approx(scaled[1], rel=1e-9)


def test_a_mirrored_image_scores_the_same() -> None:
    """Errors know no order: a permutation of the pixels changes nothing but the last digits."""
    truth, prediction = random_depths(7)
    order = np.random.default_rng(0).permutation(truth.size)
    slope = np.random.default_rng(1).normal(0, 0.2, truth.size)
    for form in (pixel_metrics, kernels):
        before, after = (
            score(form, truth, prediction, slope),
            score(form, truth[order], prediction[order], slope[order]),
        )
        assert before == pytest.approx(after, rel=1e-12)


def test_units_change_with_the_unit_of_length() -> None:
    """In centimetres: relative figures stay, lengths grow a hundredfold, inverse ones shrink."""
    truth, prediction = random_depths(8)
    slope = np.random.default_rng(1).normal(0, 0.2, truth.size)
    sums = [
        pixel_metrics.pixel_sums(
            k * truth, k * prediction, slope, np.ones(1), NO_EDGES, (0, 1e9), TAUS, False
        )
        for k in (1.0, 100.0)
    ]
    metres, centimetres = (metrics_of(s) for s in sums)
    powers = {
        "sq_rel": 1,
        "rmse": 1,
        "mae": 1,
        "height_abs_diff": 1,
        "height_rmse": 1,
        "irmse": -1,
        "imae": -1,
    }
    for name in set(METRICS) - {"height_delta_1", "height_delta_2"}:
        factor = 100.0 ** powers.get(name, 0)
        assert centimetres[name] == pytest.approx(factor * metres[name], rel=1e-9), name
