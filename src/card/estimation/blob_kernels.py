"""Registration to what is no plane, compiled: a Gaussian a voxel."""

import numba
import numpy as np
from numpy.typing import NDArray

from card.estimation.plane_kernels import BLOB, EMPTY, IS_BLOB, MEAN, VALID, find, voxel_key

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Factor on a blob's standard deviations: the points of a trunk or crown are those of the side seen so far,
#: so they err together, towards where the car came from. Much more, and nothing holds a scan among trees.
SIDED = 2.0


@numba.njit(cache=True)
def linearize_blobs(
    table: Integers,
    keys: Integers,
    planes: Array,
    points: Array,
    pending: NDArray[np.bool_],
    pose: Array,
    leaf: float,
    kernel2: float,
    H: Array,
    b: Array,
) -> float:
    """Add to the normal equations the points (N, 3) that are pending (N,) and fall on a blob: settle them.

    The residual is the Mahalanobis distance from the voxel's Gaussian (P. Biber, W. Strasser, "The Normal
    Distributions Transform", IROS 2003), of which each of three components is cut at kernel2 variances. Weak
    beside planes, also by SIDED, it holds a scan in a wood. Returns the sum of the kernel's weights.
    """
    score = 0.0
    W, J, WJ, e = np.empty((3, 3)), np.empty((3, 6)), np.empty((3, 6)), np.empty(3)
    J[:, 3:] = pose[:3, :3]
    for n in range(len(points)):
        if not pending[n]:
            continue
        px, py, pz = points[n, 0], points[n, 1], points[n, 2]
        x = pose[0, 0] * px + pose[0, 1] * py + pose[0, 2] * pz + pose[0, 3]
        y = pose[1, 0] * px + pose[1, 1] * py + pose[1, 2] * pz + pose[1, 3]
        z = pose[2, 0] * px + pose[2, 1] * py + pose[2, 2] * pz + pose[2, 3]
        slot = table[find(table, keys, voxel_key(x, y, z, leaf))]
        if slot == EMPTY or planes[slot, VALID] != IS_BLOB:
            continue
        pending[n] = False
        blob = planes[slot]
        W[0, 0], W[0, 1], W[0, 2] = blob[BLOB], blob[BLOB + 1], blob[BLOB + 2]
        W[1, 0], W[1, 1], W[1, 2] = blob[BLOB + 1], blob[BLOB + 3], blob[BLOB + 4]
        W[2, 0], W[2, 1], W[2, 2] = blob[BLOB + 2], blob[BLOB + 4], blob[BLOB + 5]
        e[0], e[1], e[2] = x - blob[MEAN], y - blob[MEAN + 1], z - blob[MEAN + 2]
        squared = 0.0
        for i in range(3):
            for j in range(3):
                squared += e[i] * W[i, j] * e[j]
        u = squared / (3.0 * kernel2)
        if u >= 1.0:
            continue
        w = (1.0 - u) ** 2
        score += w
        w /= SIDED**2
        for r in range(3):
            J[r, 0] = pose[r, 2] * py - pose[r, 1] * pz
            J[r, 1] = pose[r, 0] * pz - pose[r, 2] * px
            J[r, 2] = pose[r, 1] * px - pose[r, 0] * py
        for r in range(3):
            for c in range(6):
                WJ[r, c] = w * (W[r, 0] * J[0, c] + W[r, 1] * J[1, c] + W[r, 2] * J[2, c])
        for i in range(6):
            for k in range(3):
                b[i] -= WJ[k, i] * e[k]
                for j in range(i, 6):
                    H[i, j] += J[k, i] * WJ[k, j]
    return score
