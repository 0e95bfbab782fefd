"""The loops of `plane_map`, compiled: hashing of voxels, eigenvalues, planes, Gauss-Newton."""

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

EMPTY = np.int64(-1)
#: Columns of a voxel's moments: count, sum (3) and sum of products (6), about the voxel's centre.
MOMENTS = 10
#: Columns of a voxel's surface: mean (3), normal (3), smallest and middle eigenvalue, count when fitted,
#: kind; of a blob also its information (6), row by row from the diagonal on.
PLANE = 16
MEAN, NORMAL, THIN, MIDDLE, FITTED, VALID, BLOB = 0, 3, 6, 7, 8, 9, 10
#: Kinds: too little is known; flat; anything else, such as a trunk or a bush.
UNKNOWN, IS_PLANE, IS_BLOB = 0.0, 1.0, 2.0
#: Standard deviation below which a blob is not known, m: its points are few and lie anywhere on it.
BLOB_SIGMA = 0.05
#: A plane is fitted anew when its voxel has grown by this share.
GROWTH = 1.1
#: Of a line, the second eigenvalue is less than this share of the first; it is steep from this sine on.
LINE, STEEP = 0.05, 0.5
_BIAS, _BITS = 1 << 20, 21
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_SWEEPS = 8


@numba.njit(cache=True)
def voxel_key(x: float, y: float, z: float, leaf: float) -> int:
    """One integer for the voxel of a point; up to a million voxels from the origin along each axis."""
    i = np.int64(np.floor(x / leaf)) + _BIAS
    j = np.int64(np.floor(y / leaf)) + _BIAS
    k = np.int64(np.floor(z / leaf)) + _BIAS
    return int((i << (2 * _BITS)) | (j << _BITS) | k)


@numba.njit(cache=True)
def find(table: Integers, keys: Integers, key: int) -> int:
    """Place in the table where a key's voxel is, or where it would go."""
    mask = len(table) - 1
    place = int((np.uint64(key) * _GOLDEN) >> np.uint64(20)) & mask
    while table[place] != EMPTY and keys[table[place]] != key:
        place = (place + 1) & mask
    return place


@numba.njit(cache=True)
def fill_table(table: Integers, keys: Integers, used: int) -> None:
    """Enter the first `used` voxels into an empty table."""
    for slot in range(used):
        table[find(table, keys, keys[slot])] = slot


@numba.njit(cache=True)
def add_points(
    table: Integers,
    keys: Integers,
    moments: Array,
    touched: Integers,
    used: int,
    points: Array,
    leaf: float,
    now: int,
) -> int:
    """Add points to their voxels; returns the new number of voxels."""
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        key = voxel_key(x, y, z, leaf)
        place = find(table, keys, key)
        slot = table[place]
        if slot == EMPTY:
            slot = used
            used += 1
            table[place] = slot
            keys[slot] = key
            moments[slot] = 0.0
        touched[slot] = now
        x -= (np.floor(x / leaf) + 0.5) * leaf
        y -= (np.floor(y / leaf) + 0.5) * leaf
        z -= (np.floor(z / leaf) + 0.5) * leaf
        m = moments[slot]
        m[0] += 1.0
        m[1] += x
        m[2] += y
        m[3] += z
        m[4] += x * x
        m[5] += x * y
        m[6] += x * z
        m[7] += y * y
        m[8] += y * z
        m[9] += z * z
    return used


@numba.njit(cache=True)
def eigen(s: Array, vectors: Array) -> None:
    """Diagonalise a symmetric matrix (3, 3) in place; its eigenvectors: columns of `vectors` (Jacobi)."""
    vectors[:] = np.eye(3)
    for _ in range(_SWEEPS):
        if abs(s[0, 1]) + abs(s[0, 2]) + abs(s[1, 2]) < 1e-14 * (s[0, 0] + s[1, 1] + s[2, 2]):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if s[p, q] == 0.0:
                    continue
                theta = (s[q, q] - s[p, p]) / (2.0 * s[p, q])
                t = 1.0 / (abs(theta) + np.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / np.sqrt(t * t + 1.0)
                sn = t * c
                for k in range(3):
                    a, b = s[k, p], s[k, q]
                    s[k, p], s[k, q] = c * a - sn * b, sn * a + c * b
                for k in range(3):
                    a, b = s[p, k], s[q, k]
                    s[p, k], s[q, k] = c * a - sn * b, sn * a + c * b
                for k in range(3):
                    a, b = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * a - sn * b, sn * a + c * b


@numba.njit(cache=True)
def fit_planes(
    keys: Integers,
    moments: Array,
    planes: Array,
    touched: Integers,
    used: int,
    now: int,
    leaf: float,
    min_points: int,
    max_thickness: float,
    min_spread: float,
) -> None:
    """Fit the planes of voxels touched `now` that have grown enough since the last time."""
    scatter, vectors = np.empty((3, 3)), np.empty((3, 3))
    for slot in range(used):
        m, plane = moments[slot], planes[slot]
        if touched[slot] != now or m[0] < min_points or m[0] < GROWTH * plane[FITTED]:
            continue
        plane[FITTED] = m[0]
        mx, my, mz = m[1] / m[0], m[2] / m[0], m[3] / m[0]
        scatter[0, 0] = m[4] / m[0] - mx * mx
        scatter[0, 1] = scatter[1, 0] = m[5] / m[0] - mx * my
        scatter[0, 2] = scatter[2, 0] = m[6] / m[0] - mx * mz
        scatter[1, 1] = m[7] / m[0] - my * my
        scatter[1, 2] = scatter[2, 1] = m[8] / m[0] - my * mz
        scatter[2, 2] = m[9] / m[0] - mz * mz
        eigen(scatter, vectors)
        low, high = 0, 0
        for k in range(1, 3):
            if scatter[k, k] < scatter[low, low]:
                low = k
            if scatter[k, k] >= scatter[high, high]:
                high = k
        middle = 3 - low - high
        key = keys[slot]
        i = (key >> (2 * _BITS)) - _BIAS
        j = ((key >> _BITS) & ((1 << _BITS) - 1)) - _BIAS
        k = (key & ((1 << _BITS) - 1)) - _BIAS
        plane[MEAN] = mx + (i + 0.5) * leaf
        plane[MEAN + 1] = my + (j + 0.5) * leaf
        plane[MEAN + 2] = mz + (k + 0.5) * leaf
        plane[NORMAL : NORMAL + 3] = vectors[:, low]
        plane[THIN] = max(scatter[low, low], 0.0)
        plane[MIDDLE] = scatter[middle, middle]
        flat = plane[THIN] < max_thickness**2 and plane[MIDDLE] > min_spread**2
        if flat and low != high:
            plane[VALID] = IS_PLANE
            continue
        # A ring of the sensor on flat ground lies where the sensor is, not where the ground has a mark: it
        # would hold a moving scan back. A pole is a line too, but a steep one.
        if plane[MIDDLE] < LINE * scatter[high, high] and abs(vectors[2, high]) < STEEP:
            plane[VALID] = UNKNOWN
            continue
        plane[VALID] = IS_BLOB
        column = BLOB
        for i in range(3):
            for j in range(i, 3):
                plane[column] = 0.0
                for e in range(3):
                    plane[column] += vectors[i, e] * vectors[j, e] / (scatter[e, e] + BLOB_SIGMA**2)
                column += 1


@numba.njit(cache=True)
def linearize(
    table: Integers,
    keys: Integers,
    planes: Array,
    points: Array,
    pending: NDArray[np.bool_],
    pose: Array,
    leaf: float,
    floor2: float,
    kernel2: float,
    H: Array,
    b: Array,
) -> tuple[int, int, float, float]:
    """Add to the normal equations the points (N, 3) that are pending (N,) and fall on a plane: settle them.

    Returns points on planes, inliers, sum of squares (m^2) and of the kernel's weights.

    Residual: distance of the moved point from its voxel's plane. Its variance is that of the plane's
    thickness, of the fitted plane at that place, and the floor. Tukey's kernel cuts at kernel2 variances.
    """
    J = np.empty(6)
    known, inliers, squares, score = 0, 0, 0.0, 0.0
    for n in range(len(points)):
        if not pending[n]:
            continue
        px, py, pz = points[n, 0], points[n, 1], points[n, 2]
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        slot = table[find(table, keys, voxel_key(x, y, z, leaf))]
        if slot == EMPTY or planes[slot, VALID] != IS_PLANE:
            continue
        plane = planes[slot]
        known += 1
        pending[n] = False
        dx, dy, dz = x - plane[MEAN], y - plane[MEAN + 1], z - plane[MEAN + 2]
        r = dx * plane[NORMAL] + dy * plane[NORMAL + 1] + dz * plane[NORMAL + 2]
        across = dx * dx + dy * dy + dz * dz - r * r
        variance = plane[THIN] * (1.0 + (1.0 + across / plane[MIDDLE]) / plane[FITTED]) + floor2
        u = r * r / (kernel2 * variance)
        if u >= 1.0:
            continue
        inliers += 1
        squares += r * r
        score += (1.0 - u) ** 2
        w = (1.0 - u) ** 2 / variance
        nx = pose[0, 0] * plane[NORMAL] + pose[1, 0] * plane[NORMAL + 1] + pose[2, 0] * plane[NORMAL + 2]
        ny = pose[0, 1] * plane[NORMAL] + pose[1, 1] * plane[NORMAL + 1] + pose[2, 1] * plane[NORMAL + 2]
        nz = pose[0, 2] * plane[NORMAL] + pose[1, 2] * plane[NORMAL + 1] + pose[2, 2] * plane[NORMAL + 2]
        J[0] = py * nz - pz * ny
        J[1] = pz * nx - px * nz
        J[2] = px * ny - py * nx
        J[3], J[4], J[5] = nx, ny, nz
        for i in range(6):
            b[i] -= w * r * J[i]
            for j in range(i, 6):
                H[i, j] += w * J[i] * J[j]
    return known, inliers, squares, score


@numba.njit(cache=True)
def voxel_means(points: Array, leaf: float) -> Array:
    """Mean (M, 3) of the points (N, 3) of each voxel, in order of first appearance."""
    size = 1
    while size < 2 * len(points) + 2:
        size *= 2
    table = np.full(size, EMPTY, dtype=np.int64)
    keys = np.empty(len(points), dtype=np.int64)
    sums = np.zeros((len(points), 4))
    used = 0
    for n in range(len(points)):
        key = voxel_key(points[n, 0], points[n, 1], points[n, 2], leaf)
        place = find(table, keys, key)
        slot = table[place]
        if slot == EMPTY:
            slot = used
            used += 1
            table[place] = slot
            keys[slot] = key
        for k in range(3):
            sums[slot, k] += points[n, k]
        sums[slot, 3] += 1.0
    result = np.empty((used, 3))
    for slot in range(used):
        for k in range(3):
            result[slot, k] = sums[slot, k] / sums[slot, 3]
    return result
