"""The points of a sweep in the world, each with the pose of its own time, compiled."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: Rotations between two poses below this angle, rad, are interpolated without slerp's sines.
SMALL_RAD = 1e-6


@numba.njit(cache=True, nogil=True, error_model="numpy")
def place(
    points: Array,
    ring: NDArray[np.uint8],
    offset_ns: NDArray[np.uint32],
    turns: Array,
    rig_from_lidar: Array,
    knots_ns: Index,
    translation_m: Array,
    rotation_wxyz: Array,
) -> Array:
    """World points (N, 3) of raw points (N, 3) in the sensor frame.

    turns : (32, 5) a channel: offset of the range, cosine and sine of the offsets of elevation and azimuth.
    knots_ns : (K,) times of the poses (K, 3), (K, 4) on the clock of `offset_ns`, which they cover.
    """
    world = np.empty((len(points), 3))
    k, last = -1, len(knots_ns) - 2
    angle, sine, step = 0.0, 1.0, 1.0
    q, t = np.zeros(4), np.zeros(3)
    for n in range(len(points)):
        p0, p1, p2 = _corrected(points[n, 0], points[n, 1], points[n, 2], turns[ring[n]])
        r0 = _row(rig_from_lidar[0], p0, p1, p2)
        r1 = _row(rig_from_lidar[1], p0, p1, p2)
        r2 = _row(rig_from_lidar[2], p0, p1, p2)
        time, before = np.int64(offset_ns[n]), k
        k = max(k, 0)
        while k < last and time >= knots_ns[k + 1]:
            k += 1
        while k > 0 and time < knots_ns[k]:
            k -= 1
        if k != before:
            cosine = 0.0
            for i in range(4):
                cosine += rotation_wxyz[k, i] * rotation_wxyz[k + 1, i]
            angle = np.arccos(min(max(cosine, -1.0), 1.0))
            sine = np.sin(angle)
            step = np.float64(knots_ns[k + 1] - knots_ns[k])
        w1 = (time - knots_ns[k]) / step
        w0 = 1.0 - w1
        for i in range(3):
            t[i] = w0 * translation_m[k, i] + w1 * translation_m[k + 1, i]
        if angle >= SMALL_RAD:
            w0, w1 = np.sin(w0 * angle) / sine, np.sin(w1 * angle) / sine
        for i in range(4):
            q[i] = w0 * rotation_wxyz[k, i] + w1 * rotation_wxyz[k + 1, i]
        a, b, c, d = q
        # r + 2 v x (v x r + a r) / q^2, with v = (b, c, d)
        double = 2.0 / (a * a + b * b + c * c + d * d)
        u0 = c * r2 - d * r1 + a * r0
        u1 = d * r0 - b * r2 + a * r1
        u2 = b * r1 - c * r0 + a * r2
        world[n, 0] = r0 + double * (c * u2 - d * u1) + t[0]
        world[n, 1] = r1 + double * (d * u0 - b * u2) + t[1]
        world[n, 2] = r2 + double * (b * u1 - c * u0) + t[2]
    return world


@numba.njit(cache=True, nogil=True, error_model="numpy")
def corrected(points: Array, ring: NDArray[np.uint8], turns: Array) -> Array:
    """Corrected points (N, 3) in the sensor frame of raw ones, as `correct_points` has them."""
    result = np.empty((len(points), 3))
    for n in range(len(points)):
        result[n, 0], result[n, 1], result[n, 2] = _corrected(
            points[n, 0], points[n, 1], points[n, 2], turns[ring[n]]
        )
    return result


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _corrected(x: float, y: float, z: float, turn: Array) -> tuple[float, float, float]:
    offset, cos_up, sin_up, cos_az, sin_az = turn
    flat = np.sqrt(x * x + y * y)
    distance = np.sqrt(flat * flat + z * z)
    scale = 1.0 + offset / distance if distance > 0 else 1.0
    stretch = scale * (cos_up - sin_up * z / flat) if flat > 0 else scale * cos_up
    return (
        stretch * (x * cos_az + y * sin_az),
        stretch * (y * cos_az - x * sin_az),
        scale * (z * cos_up + flat * sin_up),
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _row(row: Array, x: float, y: float, z: float) -> float:
    return row[0] * x + row[1] * y + row[2] * z + row[3]
