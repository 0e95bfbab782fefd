"""Returns of both LiDARs on planes of the map they make together, as normal equations.

A plane's own parameters are eliminated: what is left is what its points say of poses, mountings and
corrections, whatever the plane is (as Z. Liu, F. Zhang, "BALM: Bundle Adjustment for Lidar Mapping",
RA-L 2021, with per-voxel planes and a robust kernel).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dsyrk

from card.calibration.drive import plane_kernels as kernels
from card.calibration.drive.rays import Rays
from card.calibration.drive.state import State
from card.geometry import Trajectory
from card.recording.paths import LIDARS

Array = NDArray[np.float64]
#: Voxels whose planes are eliminated at once.
_TOGETHER = 512


@dataclass(frozen=True)
class PlaneLimits:
    """When points of a voxel are a plane, and how they count.

    thickness_m : greatest sigma across.  width_m : least sigma along its narrower side.  sigma_m : of a
    surface about its plane.  range_m : sigma of a range.  kernel_sigmas : cut of Tukey's kernel.  count :
    points that those of a plane count as at most, for they share errors of its shape.
    """

    leaf_m: float
    least: int
    thickness_m: float
    width_m: float
    sigma_m: float
    range_m: float
    kernel_sigmas: float
    count: float

    @classmethod
    def from_settings(cls, settings: Mapping[str, Any], thickness_m: float) -> "PlaneLimits":
        """From the settings, for planes up to a thickness."""
        return cls(
            leaf_m=settings["plane_leaf_m"],
            least=settings["min_plane_points"],
            thickness_m=thickness_m,
            width_m=settings["min_plane_width_m"],
            sigma_m=settings["plane_sigma_m"],
            range_m=settings["range_sigma_m"],
            kernel_sigmas=settings["kernel_sigmas"],
            count=settings["plane_points"],
        )


@dataclass(frozen=True)
class Fit:
    """How returns fit: number of planes; by LiDAR, returns (2,), on planes, inliers, and their rms (m)."""

    planes: int
    returns: NDArray[np.int64]
    on_planes: NDArray[np.int64]
    inliers: NDArray[np.int64]
    rms_m: Array


class Returns:
    """The returns between the first and the last knot, with their places between knots and IMU samples."""

    def __init__(self, rays: Rays, t_ns: NDArray[np.int64], dense_ns: NDArray[np.int64]) -> None:
        """t_ns (K,) : the knots.  dense_ns (D,) : times at which the trajectory will be given."""
        inside = (rays.time_ns >= t_ns[0]) & (rays.time_ns < t_ns[-1])
        time_ns = rays.time_ns[inside]
        self._raw = rays.points[inside]
        self._ring, self._lidar = rays.ring[inside], rays.lidar[inside]
        self._knot, self._knot_share = _between(time_ns, t_ns)
        self._at, self._share = _between(time_ns, dense_ns)
        self._rays = rays
        self._inside = inside

    def __len__(self) -> int:
        return len(self._ring)

    def world(self, state: State, trajectory: Trajectory) -> tuple[Array, Array]:
        """Corrected points (N, 3) in their sensors, and in the world."""
        points = self._rays.corrected(state.documents())[self._inside]
        dense = trajectory.at(trajectory.t_ns)
        placed = kernels.place(points, self._lidar, self._at, self._share, dense, state.mounted)
        return points, placed

    def add(self, state: State, trajectory: Trajectory, limits: PlaneLimits, H: Array, g: Array) -> Fit:
        """Add to the leading parts of H (P, P) and g (P,) what the returns say; returns how they fit."""
        at = state.columns
        points, world = self.world(state, trajectory)
        keys = kernels.voxel_keys(world, limits.leaf_m)
        order = np.argsort(keys, kind="stable")
        edges = np.flatnonzero(np.diff(keys[order])) + 1
        starts = np.concatenate([[0], edges, [len(order)]])
        # Voxels of too few points are left out before the loops: most are.
        starts, ends = starts[:-1], starts[1:]
        enough = ends - starts >= limits.least
        order = np.concatenate(
            [order[a:b] for a, b in zip(starts[enough], ends[enough], strict=True)] or [order[:0]]
        )
        starts = np.concatenate([[0], np.cumsum((ends - starts)[enough])])
        size = at.lidar_size
        normal, right = np.zeros((size, size)), np.zeros(size)
        G, b = np.empty((3 * _TOGETHER, size)), np.empty(3 * _TOGETHER)
        found = np.zeros((len(LIDARS), kernels.STATISTICS))
        first = np.array(
            [at.mountings, at.mountings + 6, at.corrections, at.corrections + kernels.CORRECTIONS]
        )
        bounds = np.array(
            [
                limits.least,
                limits.thickness_m,
                limits.width_m,
                limits.sigma_m,
                limits.range_m,
                limits.kernel_sigmas,
                limits.count,
            ]
        )
        dense = trajectory.at(trajectory.t_ns)
        planes = 0
        for low in range(0, len(starts) - 1, _TOGETHER):
            some = starts[low : low + _TOGETHER + 1]
            count = kernels.add_planes(
                order, some, world, points, self._lidar, self._ring, self._at, self._share, self._knot,
                self._knot_share, dense, state.mounted, first, bounds, normal, right, G, b, found,
            )  # fmt: skip
            rows = G[: 3 * count]
            # Upper part only, in the order of memory that the library wants.
            normal -= dsyrk(1.0, rows.T, trans=0).reshape(size, size) if count else 0.0
            right -= rows.T @ b[: 3 * count]
            planes += count
        normal = np.triu(normal)
        H[:size, :size] += normal + np.triu(normal, 1).T
        g[:size] += right
        inliers = found[:, 1].astype(np.int64)
        return Fit(
            planes,
            np.array([int(np.count_nonzero(self._lidar == i)) for i in range(len(LIDARS))]),
            found[:, 0].astype(np.int64),
            inliers,
            np.sqrt(found[:, 2] / np.maximum(inliers, 1)),
        )


def _between(t_ns: NDArray[np.int64], edges_ns: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array]:
    """Of each time the interval it lies in, and the share of it that has passed."""
    at = np.clip(np.searchsorted(edges_ns, t_ns, side="right") - 1, 0, len(edges_ns) - 2)
    return at, (t_ns - edges_ns[at]) / (edges_ns[at + 1] - edges_ns[at])
