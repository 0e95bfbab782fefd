"""A map of planes, one a voxel, grown scan by scan, and robust point-to-plane registration to it.

After C. Yuan et al., "Efficient and Probabilistic Adaptive Voxel Mapping for Accurate Online LiDAR Odometry",
RA-L 2022, with two sizes of voxel. Written for what small_gicp's maps cannot do from Python: planes of all
scans so far instead of normals from one scan's rings, a robust kernel, and residuals in metres, so that the
information about a pose is in the pose's own units.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.estimation import plane_kernels as kernels
from card.estimation.blob_kernels import linearize_blobs

Array = NDArray[np.float64]
#: How far a registration may lie from its guess where nothing in the map says more (one sigma): rad, m.
LOOSE = np.array([0.2, 0.2, 0.2, 1.0, 1.0, 1.0])
_CONVERGED = np.array([1e-6, 1e-6, 1e-6, 1e-5, 1e-5, 1e-5])


@dataclass(frozen=True)
class PlaneSettings:
    """How planes are taken and points matched to them.

    leaf_m : edge of a voxel.  min_points : points from which a voxel has a plane.
    max_thickness_m : root of the smallest eigenvalue up to which a voxel is flat.
    min_spread_m : root of the middle eigenvalue from which on it is more than a line.
    sigma_m : floor of a residual's sigma.  kernel_sigmas : where Tukey's kernel cuts, sigmas.
    """

    leaf_m: float = 1.0
    min_points: int = 8
    max_thickness_m: float = 0.06
    min_spread_m: float = 0.05
    sigma_m: float = 0.005
    kernel_sigmas: float = 4.0


@dataclass(frozen=True)
class Registration:
    """Where a scan lies in a map.

    map_from_scan : (4, 4).
    information : (6, 6) of the pose, in the scan's own axes: rotation (1/rad^2) before translation (1/m^2).
    known_fraction, inlier_fraction : shares of the scan's points that fall on planes of the map, and fit.
    rms_m : root mean square distance of the inliers from their planes.
    score : mean weight of all points, on planes or not: how well the scan fits as a whole.
    """

    map_from_scan: Array
    information: Array
    known_fraction: float
    inlier_fraction: float
    rms_m: float
    score: float


class PlaneMap:
    """Planes of voxels of `leaf_m`, of twice that where those have none, and blobs; one frame, metres."""

    def __init__(self, settings: PlaneSettings, horizon: int | None = None) -> None:
        """horizon : insertions after which a voxel that none of them touched is forgotten; None for never."""
        self.settings = settings
        self._levels = [_Level(settings, settings.leaf_m * factor, horizon) for factor in (1.0, 2.0)]

    def __len__(self) -> int:
        return self._levels[0].used

    def insert(self, points: Array) -> None:
        """Add points (N, 3)."""
        for level in self._levels:
            level.insert(points)

    def thickness(self) -> Array:
        """Standard deviations (V,) of the points across the planes of the smaller voxels, m."""
        return self._levels[0].thickness()

    def register(self, points: Array, guess: Array, iterations: int = 12, widen: float = 1.0) -> Registration:
        """The pose of points (N, 3) in the map, from a guess of map_from_scan (4, 4).

        widen : factor on the kernel's cut in the first half of the iterations, for a poor guess.
        """
        pose: Array = np.array(guess, dtype=np.float64)
        H, b = np.zeros((6, 6)), np.zeros(6)
        known = inliers = 0
        squares = score = 0.0
        weak = np.diag(LOOSE**-2)
        for k in range(iterations):
            cut = self.settings.kernel_sigmas * (widen if 2 * k < iterations else 1.0)
            known, inliers, squares, score = self._linearize(points, pose, cut, H, b)
            step = np.linalg.solve(H + weak, b).astype(np.float64)
            pose = pose @ _exp(step)
            if np.all(np.abs(step) < _CONVERGED) and (widen == 1.0 or 2 * k >= iterations):
                break
        count = max(len(points), 1)
        rms = float(np.sqrt(squares / inliers)) if inliers else 0.0
        return Registration(pose, H, known / count, inliers / count, rms, score / count)

    def _linearize(
        self, points: Array, pose: Array, cut: float, H: Array, b: Array
    ) -> tuple[int, int, float, float]:
        H[:], b[:] = 0.0, 0.0
        pending = np.ones(len(points), dtype=bool)
        sums = [level.linearize(points, pending, pose, cut, H, b) for level in self._levels]
        score = sum(level.linearize_blobs(points, pending, pose, cut, H, b) for level in self._levels)
        H[:] = np.triu(H) + np.triu(H, 1).T
        known, inliers, squares, fits = (sum(values) for values in zip(*sums, strict=True))
        return int(known), int(inliers), float(squares), float(fits + score)


class _Level:
    """Voxels of one size: their moments and planes in order of appearance, and a hash table of their keys."""

    def __init__(self, settings: PlaneSettings, leaf_m: float, horizon: int | None) -> None:
        self._settings, self._leaf_m, self._horizon = settings, leaf_m, horizon
        self._insertions = self.used = 0
        self._table = np.full(1 << 14, kernels.EMPTY, dtype=np.int64)
        self._keys = np.empty(1 << 13, dtype=np.int64)
        self._touched = np.zeros(1 << 13, dtype=np.int64)
        self._moments = np.zeros((1 << 13, kernels.MOMENTS))
        self._planes = np.zeros((1 << 13, kernels.PLANE))

    def insert(self, points: Array) -> None:
        s = self._settings
        self._insertions += 1
        if self._horizon is not None and self._insertions % 16 == 0:
            self._keep(np.flatnonzero(self._touched[: self.used] >= self._insertions - self._horizon))
        self._reserve(self.used + len(points))
        voxels = self._table, self._keys, self._moments, self._touched
        self.used = kernels.add_points(*voxels, self.used, points, self._leaf_m, self._insertions)
        kernels.fit_planes(
            self._keys,
            self._moments,
            self._planes,
            self._touched,
            self.used,
            self._insertions,
            self._leaf_m,
            s.min_points,
            s.max_thickness_m,
            s.min_spread_m,
        )

    def thickness(self) -> Array:
        planes = self._planes[: self.used]
        return np.asarray(np.sqrt(planes[planes[:, kernels.VALID] == kernels.IS_PLANE, kernels.THIN]))

    def linearize(
        self, points: Array, pending: NDArray[np.bool_], pose: Array, cut: float, H: Array, b: Array
    ) -> tuple[int, int, float, float]:
        planes = self._table, self._keys, self._planes
        floor2 = self._settings.sigma_m**2
        return kernels.linearize(*planes, points, pending, pose, self._leaf_m, floor2, cut**2, H, b)

    def linearize_blobs(
        self, points: Array, pending: NDArray[np.bool_], pose: Array, cut: float, H: Array, b: Array
    ) -> float:
        planes = self._table, self._keys, self._planes
        return float(linearize_blobs(*planes, points, pending, pose, self._leaf_m, cut**2, H, b))

    def _reserve(self, count: int) -> None:
        if count > len(self._keys):
            size = max(2 * len(self._keys), count)
            self._keys, self._touched, self._moments, self._planes = (
                np.concatenate([old[: self.used], np.zeros((size - self.used, *old.shape[1:]), old.dtype)])
                for old in (self._keys, self._touched, self._moments, self._planes)
            )
        if 2 * count > len(self._table):
            self._index(2 * count)

    def _keep(self, slots: NDArray[np.int64]) -> None:
        for array in (self._keys, self._touched, self._moments, self._planes):
            array[: len(slots)] = array[slots]
            array[len(slots) : self.used] = 0
        self.used = len(slots)
        self._index(len(self._table))

    def _index(self, size: int) -> None:
        self._table = np.full(1 << int(np.ceil(np.log2(size))), kernels.EMPTY, dtype=np.int64)
        kernels.fill_table(self._table, self._keys, self.used)


def _exp(step: Array) -> Array:
    """A small transform (4, 4): rotation vector and translation (6,), to first order in their coupling."""
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(step[:3]).as_matrix()
    pose[:3, 3] = step[3:]
    return pose
