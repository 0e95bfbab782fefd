"""The evaluator's inner loops, compiled; the plain forms give the same and serve where numba is absent.

`nearest_points` replaces `card.geometry.rasterize`, `gather` indexing, `pixel_sums` its namesake in
`card.benchmark.pixel_metrics`. Nothing here runs in parallel or with fast-math, so that results repeat.
"""

from typing import Any

import numba
import numpy as np

from card.benchmark.pixel_metrics import DELTA_BASE, SUMS

#: Float64 bits that tell a value's bin in the first pass of `median`.
BIN_BITS, REST_BITS = 18, 45

#: A kernel's cache knows its own file only: what is defined elsewhere comes in as an argument.
kernel = numba.njit(nogil=True, cache=True, error_model="numpy")


@kernel
def nearest_points(
    points: Any, pinhole: Any, distortion: Any, max_radius2: float, width: int, height: int, depth: Any
) -> Any:
    """Pixels (M,) that points (N, 3) fall on, and the nearest z of each; `depth` (H*W,) float32 is scratch.

    depth must be inf everywhere and is so again afterwards. pinhole : fx, fy, cx, cy.
    """
    fx, fy, cx, cy = pinhole
    k1, k2, p1, p2, k3 = distortion
    pixels = np.empty(points.shape[0], dtype=np.int64)
    count = 0
    for i in range(points.shape[0]):
        z = points[i, 2]
        if not z > 0:
            continue
        x = np.float64(points[i, 0]) / np.float64(z)
        y = np.float64(points[i, 1]) / np.float64(z)
        r2 = x * x + y * y
        if r2 >= max_radius2:
            continue
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) * fx + cx
        v = (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) * fy + cy
        if not (-0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5):
            continue
        pixel = int(np.floor(v + 0.5)) * width + int(np.floor(u + 0.5))
        before = depth[pixel]
        if z < before:
            if before == np.inf:
                pixels[count] = pixel
                count += 1
            depth[pixel] = z
    pixels = pixels[:count].copy()
    nearest = np.empty(count)
    for i in range(count):
        nearest[i] = depth[pixels[i]]
        depth[pixels[i]] = np.inf
    return pixels, nearest


@kernel
def pixel_rays(
    width: int, height: int, pinhole: Any, distortion: Any, iterations: int, tolerance: float
) -> Any:
    """x, y (H*W, 2) of the rays of all pixels, as `CameraModel.rays` iterates; and the largest last step."""
    fx, fy, cx, cy = pinhole
    k1, k2, p1, p2, k3 = distortion
    rays = np.empty((height * width, 2))
    worst = 0.0
    for i in range(height * width):
        wanted_x = (i % width - cx) / fx
        wanted_y = (i // width - cy) / fy
        x, y = wanted_x, wanted_y
        step = np.inf
        for _ in range(iterations):
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            step_x = wanted_x - (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x))
            step_y = wanted_y - (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y)
            x += step_x
            y += step_y
            step = max(abs(step_x), abs(step_y))
            if step < tolerance:
                break
        rays[i, 0], rays[i, 1] = x, y
        if not step <= worst:
            worst = step
    return rays, worst


@kernel
def gather(pixels: Any, prediction: Any, rays: Any, normal: Any) -> Any:
    """Prediction (M,) and slope (M,) at pixels (M,) of images prediction (H*W,) and rays (H*W, 2)."""
    p = np.empty(pixels.size)
    slope = np.empty(pixels.size)
    for i in range(pixels.size):
        pixel = pixels[i]
        p[i] = prediction[pixel]
        slope[i] = rays[pixel, 0] * normal[0] + rays[pixel, 1] * normal[1] + normal[2]
    return p, slope


def pixel_sums(
    truth: Any,
    prediction: Any,
    slope: Any,
    scales: Any,
    edges_m: Any,
    limits: Any,
    thresholds_m: Any,
    drop: bool,
) -> Any:
    """As `card.benchmark.pixel_metrics.pixel_sums`, in one pass."""
    out = np.zeros((scales.size, edges_m.size + 1, len(SUMS)))
    ratios = (DELTA_BASE, DELTA_BASE**2, DELTA_BASE**3)
    _add_pixels(truth, prediction, slope, scales, edges_m, limits, thresholds_m, drop, ratios, out)
    return out


@kernel
def _add_pixels(
    truth: Any,
    prediction: Any,
    slope: Any,
    scales: Any,
    edges: Any,
    limits: Any,
    thresholds_m: Any,
    drop: bool,
    ratios: Any,
    out: Any,
) -> None:
    near, far = limits
    tau_1, tau_2 = thresholds_m
    t1, t2, t3 = ratios
    log_scales = np.log(scales)
    for i in range(truth.size):
        d = truth[i]
        raw = prediction[i]
        given = raw > 0
        inverse_d = 1 / d
        part = 0
        while part < edges.size and d >= edges[part]:
            part += 1
        log_ratio = np.log(raw * inverse_d) if given else 0.0
        for s in range(scales.size):
            p = raw * scales[s] if given else 0.0
            valid = near <= p <= far
            row = out[s, part]  # in the order of SUMS
            row[0] += 1
            row[1] += valid
            if drop and not valid:
                continue
            c = min(max(p, near), far)
            error = c - d
            absolute = abs(error)
            squared = error * error
            inverse = 1 / c - inverse_d
            log = log_ratio + log_scales[s] if valid else np.log(c * inverse_d)
            h = abs(error * slope[i])
            row[2] += 1
            row[3] += absolute * inverse_d
            row[4] += squared * inverse_d
            row[5] += squared
            row[6] += log * log
            row[7] += (c < t1 * d) & (d < t1 * c)
            row[8] += (c < t2 * d) & (d < t2 * c)
            row[9] += (c < t3 * d) & (d < t3 * c)
            row[10] += absolute
            row[11] += abs(inverse)
            row[12] += inverse * inverse
            row[13] += h
            row[14] += h * h
            if np.isnan(h):
                row[15] = np.nan
                row[16] = np.nan
            else:
                row[15] += h < tau_1
                row[16] += h < tau_2


@kernel
def median_scale(truth: Any, prediction: Any) -> float:
    """As `card.benchmark.pixel_metrics.median_scale`, to the last bit."""
    count = 0
    for i in range(prediction.size):
        count += prediction[i] > 0
    if count == 0:
        return 1.0
    return _median(truth, prediction, count) / _median(prediction, prediction, count)


@kernel
def _median(values: Any, given: Any, count: int) -> float:
    """Exact median of the `count` values whose `given` is > 0, by bins of their leading bits."""
    bits = values.view(np.int64)
    bins = np.zeros(1 << BIN_BITS, dtype=np.int32)
    for i in range(values.size):
        if given[i] > 0:
            bins[bits[i] >> REST_BITS] += 1
    low, high = (count - 1) // 2, count // 2
    below = 0
    first = 0
    while below + bins[first] <= low:
        below += bins[first]
        first += 1
    last = first
    upto = below + bins[last]
    while upto <= high:
        last += 1
        upto += bins[last]
    few = np.empty(upto - below)
    k = 0
    for i in range(values.size):
        if given[i] > 0 and first <= bits[i] >> REST_BITS <= last:
            few[k] = values[i]
            k += 1
    few.sort()
    return (few[low - below] + few[high - below]) / 2
