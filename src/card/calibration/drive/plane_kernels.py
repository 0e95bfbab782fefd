"""The loops of `plane_residuals`, compiled: points to the world, planes of voxels, their normal equations."""

import numba
import numpy as np
from numpy.typing import NDArray

from card.estimation.plane_kernels import eigen, voxel_key

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Fits of a voxel's plane, each without what lies more than TRIM standard deviations off the one before.
_FITS, TRIM = 3, 3.0
#: Standard deviations by which points of a voxel must scatter more than they should to be believed less.
SURE = 3.0
CHANNELS = 32
#: Parameters of a LiDAR's corrections: common range offset; range, elevation and azimuth offset a channel.
CORRECTIONS = 1 + 3 * CHANNELS
_POSE = 6
#: Nonzero derivatives of a residual: two knots, a mounting, four corrections.
NONZERO = 2 * _POSE + _POSE + 4
#: Statistics a LiDAR: points on planes, inliers, sum of their squares (m^2).
STATISTICS = 3


@numba.njit(cache=True, nogil=True)
def place(
    points: Array, lidar: NDArray[np.int8], at: Integers, share: Array, dense: Array, mounted: Array
) -> Array:
    """World points (N, 3) of sensor points (N, 3).

    dense (D, 4, 4) : world_from_rig; the pose of a point lies `share` of the way from `at` to the next.
    mounted (2, 4, 4) : rig_from_lidar.
    """
    result = np.empty((len(points), 3))
    q = np.empty(3)
    for n in range(len(points)):
        m, a, b, s = mounted[lidar[n]], dense[at[n]], dense[at[n] + 1], share[n]
        for i in range(3):
            q[i] = m[i, 0] * points[n, 0] + m[i, 1] * points[n, 1] + m[i, 2] * points[n, 2] + m[i, 3]
        for i in range(3):
            total = (1.0 - s) * a[i, 3] + s * b[i, 3]
            for j in range(3):
                total += ((1.0 - s) * a[i, j] + s * b[i, j]) * q[j]
            result[n, i] = total
    return result


@numba.njit(cache=True, nogil=True)
def voxel_keys(points: Array, leaf: float) -> Integers:
    """The voxel (N,) of each point (N, 3)."""
    keys = np.empty(len(points), np.int64)
    for n in range(len(points)):
        keys[n] = voxel_key(points[n, 0], points[n, 1], points[n, 2], leaf)
    return keys


@numba.njit(cache=True, nogil=True)
def fit_plane(
    world: Array, rows: Integers, frame: Array, mean: Array, scatter: Array
) -> tuple[int, float, float]:
    """Plane of some points: its inliers, thickness and lesser width (m, one sigma each).

    rows : which of `world` (N, 3).  frame (3, 3) gets the normal, then two directions along the plane, as
    columns; mean (3,) a point of it.
    """
    used, thick, wide = 0, np.inf, 0.0
    origin = world[rows[0]]
    for fit in range(_FITS):
        used = 0
        sums, products = np.zeros(3), np.zeros((3, 3))
        for row in rows:
            d0, d1, d2 = (
                world[row, 0] - origin[0],
                world[row, 1] - origin[1],
                world[row, 2] - origin[2],
            )
            if fit > 0:
                off = (
                    frame[0, 0] * (world[row, 0] - mean[0])
                    + frame[1, 0] * (world[row, 1] - mean[1])
                    + frame[2, 0] * (world[row, 2] - mean[2])
                )
                if abs(off) > TRIM * thick:
                    continue
            used += 1
            sums[0] += d0
            sums[1] += d1
            sums[2] += d2
            products[0, 0] += d0 * d0
            products[0, 1] += d0 * d1
            products[0, 2] += d0 * d2
            products[1, 1] += d1 * d1
            products[1, 2] += d1 * d2
            products[2, 2] += d2 * d2
        if used < 4:
            return used, np.inf, 0.0
        for i in range(3):
            for j in range(i, 3):
                scatter[i, j] = products[i, j] / used - sums[i] * sums[j] / used**2
                scatter[j, i] = scatter[i, j]
        vectors = np.empty((3, 3))
        eigen(scatter, vectors)
        values = np.array([scatter[0, 0], scatter[1, 1], scatter[2, 2]])
        order = np.argsort(values)
        for k in range(3):
            frame[:, k] = vectors[:, order[k]]
            mean[k] = origin[k] + sums[k] / used
        thick, wide = np.sqrt(max(values[order[0]], 1e-12)), np.sqrt(max(values[order[1]], 0.0))
    return used, thick, wide


@numba.njit(cache=True, nogil=True)
def derivatives(
    point: Array, pose: Array, mounted: Array, normal: Array, ring: int, places: Integers, share: float,
    columns: Integers, J: Array,
) -> None:  # fmt: skip
    """Derivatives J (NONZERO,) of a distance from a plane by parameters `columns` (NONZERO,).

    point (3,) : corrected, in the sensor.  pose (3, 4) : world_from_rig at its time.  normal (3,) : world.
    places : first columns of the earlier knot, the later one, the mounting and the corrections.  share : of
    the later knot. Poses are disturbed on the right: R exp(phi), t + R rho, rotation first.
    """
    q, in_rig, in_sensor = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        q[i] = mounted[i, 0] * point[0] + mounted[i, 1] * point[1] + mounted[i, 2] * point[2] + mounted[i, 3]
        in_rig[i] = pose[0, i] * normal[0] + pose[1, i] * normal[1] + pose[2, i] * normal[2]
    for i in range(3):
        in_sensor[i] = mounted[0, i] * in_rig[0] + mounted[1, i] * in_rig[1] + mounted[2, i] * in_rig[2]
    for k in range(3):
        j, m = (k + 1) % 3, (k + 2) % 3
        turn = q[j] * in_rig[m] - q[m] * in_rig[j]
        J[k], J[6 + k] = (1.0 - share) * turn, share * turn
        J[3 + k], J[9 + k] = (1.0 - share) * in_rig[k], share * in_rig[k]
        J[12 + k] = point[j] * in_sensor[m] - point[m] * in_sensor[j]
        J[15 + k] = in_sensor[k]
    for k in range(6):
        columns[k], columns[6 + k], columns[12 + k] = places[0] + k, places[1] + k, places[2] + k
    flat = np.sqrt(point[0] ** 2 + point[1] ** 2)
    away = np.sqrt(flat**2 + point[2] ** 2)
    along = point[0] * in_sensor[0] + point[1] * in_sensor[1] + point[2] * in_sensor[2]
    J[18] = J[19] = along / away
    level = point[0] * in_sensor[0] + point[1] * in_sensor[1]
    J[20] = flat * in_sensor[2] - point[2] * level / flat
    J[21] = point[1] * in_sensor[0] - point[0] * in_sensor[1]
    columns[18] = places[3]
    for k in range(3):
        columns[19 + k] = places[3] + 1 + CHANNELS * k + ring


@numba.njit(cache=True, nogil=True)
def pose_at(dense: Array, at: int, share: float, pose: Array) -> None:
    """The pose (3, 4) that lies `share` of the way from one of dense (D, 4, 4) to the next."""
    for i in range(3):
        for j in range(4):
            pose[i, j] = (1.0 - share) * dense[at, i, j] + share * dense[at + 1, i, j]


@numba.njit(cache=True, nogil=True)
def beam(point: Array, pose: Array, mounted: Array, direction: Array) -> float:
    """Length of the ray to a point (3,) of the sensor, whose unit direction (3,) in the world is set."""
    away, in_rig = 0.0, np.empty(3)
    for i in range(3):
        in_rig[i] = mounted[i, 0] * point[0] + mounted[i, 1] * point[1] + mounted[i, 2] * point[2]
        away += point[i] ** 2
    away = np.sqrt(away)
    for i in range(3):
        direction[i] = (pose[i, 0] * in_rig[0] + pose[i, 1] * in_rig[1] + pose[i, 2] * in_rig[2]) / away
    return away


@numba.njit(cache=True, nogil=True)
def add_planes(
    order: Integers, starts: Integers, world: Array, points: Array, lidar: NDArray[np.int8],
    ring: NDArray[np.uint8], at: Integers, share: Array, knot: Integers, knot_share: Array, dense: Array,
    mounted: Array, first: Integers, limits: Array, H: Array, g: Array, G: Array, b: Array, found: Array,
) -> int:  # fmt: skip
    """Add the points of voxels to normal equations H (P, P), upper part, and g (P,).

    order (N,) : points sorted by voxel, of which voxel v has starts[v] to starts[v + 1].
    first (4,) : columns of the mountings and the corrections, of each LiDAR.
    limits : fewest points, most thickness, least width (m), sigmas of a surface about its plane and of a
        range (m), cut of Tukey's kernel (sigmas), points that a plane counts as at most. A voxel whose points
        scatter more than these sigmas say is believed less.
    G (3 V, P), b (3 V,) : rows that are to be subtracted, H - G^T G and g - G^T b: what the planes' own
        three parameters, which nobody asks for, take away.
    found (2, STATISTICS) : see there; is added to.
    Returns the number of planes.
    """
    frame, mean, scatter, pose = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty((3, 4))
    J, columns, places, a = np.empty(NONZERO), np.empty(NONZERO, np.int64), np.empty(4, np.int64), np.ones(3)
    ray, likely = np.empty(3), np.empty(3)
    planes = 0
    for v in range(len(starts) - 1):
        rows = order[starts[v] : starts[v + 1]]
        if len(rows) < limits[0]:
            continue
        used, thick, wide = fit_plane(world, rows, frame, mean, scatter)
        if used < limits[0] or thick > limits[1] or wide < limits[2]:
            continue
        variances, squares, inside = np.empty(len(rows)), 0.0, 0
        for n in range(len(rows)):
            row = rows[n]
            pose_at(dense, at[row], share[row], pose)
            beam(points[row], pose, mounted[lidar[row]], ray)
            cosine = ray[0] * frame[0, 0] + ray[1] * frame[1, 0] + ray[2] * frame[2, 0]
            variances[n] = limits[3] ** 2 + (limits[4] * cosine) ** 2
            e = 0.0
            for i in range(3):
                e += (world[row, i] - mean[i]) * frame[i, 0]
            if abs(e) < TRIM * thick:
                squares += e * e / variances[n]
                inside += 1
        excess = squares / inside
        if excess < 1.0 + SURE * np.sqrt(2.0 / inside):
            excess = 1.0
        weight = min(1.0, limits[6] / used)
        N, top = np.zeros((3, 3)), 3 * planes
        G[top : top + 3] = 0.0
        b[top : top + 3] = 0.0
        for n in range(len(rows)):
            row, variance = rows[n], excess * variances[n]
            d0, d1, d2 = world[row, 0] - mean[0], world[row, 1] - mean[1], world[row, 2] - mean[2]
            e = d0 * frame[0, 0] + d1 * frame[1, 0] + d2 * frame[2, 0]
            which = lidar[row]
            found[which, 0] += 1.0
            u = e * e / (limits[5] ** 2 * variance)
            if u >= 1.0:
                continue
            found[which, 1] += 1.0
            found[which, 2] += e * e
            w = weight * (1.0 - u) ** 2 / variance
            pose_at(dense, at[row], share[row], pose)
            away = beam(points[row], pose, mounted[which], ray)
            cosine = ray[0] * frame[0, 0] + ray[1] * frame[1, 0] + ray[2] * frame[2, 0]
            # Noise of a range moves a point along the plane, too: taken where it was measured, the plane
            # would lean towards the sensor. It is taken where its range most likely ends.
            longer = e * limits[4] ** 2 * cosine / variances[n]
            for i in range(3):
                likely[i] = points[row, i] * (1.0 - longer / away)
            places[0], places[1] = _POSE * knot[row], _POSE * knot[row] + _POSE
            places[2], places[3] = first[which], first[2 + which]
            derivatives(
                likely, pose, mounted[which], frame[:, 0], int(ring[row]), places, knot_share[row], columns, J
            )
            d0, d1, d2 = d0 - longer * ray[0], d1 - longer * ray[1], d2 - longer * ray[2]
            a[1] = (d0 * frame[0, 1] + d1 * frame[1, 1] + d2 * frame[2, 1]) / wide
            a[2] = (d0 * frame[0, 2] + d1 * frame[1, 2] + d2 * frame[2, 2]) / wide
            for i in range(NONZERO):
                ci, wi = columns[i], w * J[i]
                g[ci] -= wi * e
                for j in range(i, NONZERO):
                    # Columns rise but for the mountings and corrections, which follow the knots anyway.
                    H[ci, columns[j]] += wi * J[j]
                for k in range(3):
                    G[top + k, ci] += a[k] * wi
            for i in range(3):
                b[top + i] -= w * a[i] * e
                for j in range(3):
                    N[i, j] += w * a[i] * a[j]
        # Rows of G become those of L^-1 G, with N = L L^T.
        L = np.linalg.cholesky(N + 1e-9 * N[0, 0] * np.eye(3))
        for i in range(3):
            for k in range(i):
                G[top + i] -= L[i, k] * G[top + k]
                b[top + i] -= L[i, k] * b[top + k]
            G[top + i] /= L[i, i]
            b[top + i] /= L[i, i]
        planes += 1
    return planes
