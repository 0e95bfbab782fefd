"""Sweeps straightened and thinned, kept while they are near what is looked at."""

from collections import OrderedDict
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from card.estimation.batch import Nodes
from card.estimation.imu import Imu
from card.estimation.plane_kernels import voxel_means
from card.estimation.scans import Scan, Scans
from card.estimation.strapdown import Path, integrate
from card.geometry import Trajectory

Array = NDArray[np.float64]
#: The motion of the rig during the sweep of an ordinal.
Motion = Callable[[int, Scan], Path]


class SweepStore:
    """Points of sweeps in the rig at each sweep's end; the latest `size` of them stay in memory."""

    def __init__(
        self, scans: Scans, sweep_of: NDArray[np.intp], motion: Motion, leaf_m: float, size: int = 256
    ) -> None:
        """sweep_of (N,) : ordinals of the sweeps that are numbered from 0 here."""
        self._scans, self._sweep_of, self._motion = scans, sweep_of, motion
        self._leaf_m, self._size = leaf_m, size
        self._kept: OrderedDict[int, Array] = OrderedDict()

    def points(self, k: int) -> Array:
        """Thinned points (M, 3) of one sweep."""
        if k not in self._kept:
            scan = self._scans[int(self._sweep_of[k])]
            self._kept[k] = np.asarray(voxel_means(scan.at_end(self._motion(k, scan)), self._leaf_m))
            if len(self._kept) > self._size:
                self._kept.popitem(last=False)
        self._kept.move_to_end(k)
        return self._kept[k]


def along_nodes(nodes: Nodes, imu: Imu) -> Motion:
    """Motion up to each node, integrated back from its state; it is much the same for every solution."""

    def motion(k: int, scan: Scan) -> Path:
        samples = imu.between(scan.start_ns, int(nodes.t_ns[k]))
        unbiased = samples.without(nodes.gyro_biases[k], nodes.accel_biases[k])
        back = integrate(unbiased.backwards(), nodes.poses[k], nodes.velocities[k], nodes.gravity)
        return back.backwards()

    return motion


def along_trajectory(trajectory: Trajectory) -> Motion:
    """Motion as a trajectory has it, at its own times within the sweep."""

    def motion(_: int, scan: Scan) -> Path:
        t_ns = trajectory.t_ns
        inside = t_ns[(t_ns > scan.start_ns) & (t_ns < scan.end_ns)]
        knots = np.concatenate([[scan.start_ns], inside, [scan.end_ns]])
        pose = trajectory.at(knots)
        return Path(knots, pose[:, :3, :3], pose[:, :3, 3], np.zeros((len(knots), 3)))

    return motion
