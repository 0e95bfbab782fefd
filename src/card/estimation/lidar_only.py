"""Odometry from scans alone, for the start of a drive and for checks of the IMU: it trusts no IMU at all."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from card.errors import CardError
from card.estimation.plane_kernels import voxel_means
from card.estimation.plane_map import PlaneMap, PlaneSettings, Registration
from card.estimation.scans import Scan
from card.estimation.strapdown import Path
from card.geometry import Trajectory, apply, inverse, quaternion_from_matrix

Array = NDArray[np.float64]
#: Speeds along the rig's y that the first two scans are tried with, m/s; each converges some metres around.
SPEEDS = (0.0, 5.0, 10.0, 15.0, 20.0, 27.0, 34.0, 41.0, 48.0, 55.0, -4.0)
#: Share of points that must fit for a pair of scans to be registered at all.
MIN_SCORE = 0.15
#: Insertions after which the map forgets, and passes with the smooth motion of the one before.
HORIZON, SMOOTH_PASSES = 60, 2
_KNOTS = 11
_WIDEN = 10.0


def scan_trajectory(
    scans: Sequence[Scan], leaf_m: float, planes: PlaneSettings
) -> tuple[Trajectory, Trajectory]:
    """Poses of the rig at the ends, and in the middle, of two scans or more, in the frame of the first end.

    The middle is what a scan tells best. Scans are first straightened with the constant turn and velocity
    that the last two poses tell of (as I. Vizzo et al., "KISS-ICP", RA-L 2023), then with the smooth motion
    through the poses that came out: on a bump the pitch rate changes within a scan.

    Raises
    ------
    CardError
        If the first two scans cannot be registered at any speed of a car.
    """
    middles = _followed(scans, _first_twist(scans[0], scans[1], leaf_m, planes), leaf_m, planes)
    for _ in range(SMOOTH_PASSES):
        middles = _smoothed(scans, _Motion(scans, middles), leaf_m, planes)
    motion = _Motion(scans, middles)
    ends = motion.at([scan.end_ns for scan in scans])
    frame = inverse(ends[0])
    return (
        _trajectory([scan.end_ns for scan in scans], frame @ ends),
        _trajectory([_middle(scan) for scan in scans], frame @ np.stack(middles)),
    )


def _followed(scans: Sequence[Scan], twist: Array, leaf_m: float, planes: PlaneSettings) -> list[Array]:
    """Poses in the middle of the scans, each straightened with the twist (6,) of the step to it."""
    end = np.eye(4)
    middles = [_moved(twist, _half(scans[0]))]
    grid = PlaneMap(planes, horizon=HORIZON)
    grid.insert(straightened(scans[0], twist, leaf_m / 5))
    for before, scan in pairwise(scans):
        seconds = (scan.end_ns - before.end_ns) * 1e-9
        last, points = end, straightened(scan, twist, leaf_m)
        end = grid.register(points, last @ _moved(twist, seconds), widen=_WIDEN).map_from_scan
        twist = _twist(inverse(last) @ end, seconds)
        middles.append(end @ _moved(twist, _half(scan)))
        grid.insert(apply(end, straightened(scan, twist, leaf_m / 5)))
    return middles


def _smoothed(scans: Sequence[Scan], motion: "_Motion", leaf_m: float, planes: PlaneSettings) -> list[Array]:
    """Poses in the middle of the scans, straightened with a motion."""
    known = motion.at([_middle(scan) for scan in scans])
    middles = [known[0]]
    grid = PlaneMap(planes, horizon=HORIZON)
    grid.insert(apply(known[0], motion.straightened(scans[0], leaf_m / 5)))
    for k, scan in enumerate(scans[1:], 1):
        points = motion.straightened(scan, leaf_m / 5)
        guess = middles[-1] @ inverse(known[k - 1]) @ known[k]
        found = grid.register(np.asarray(voxel_means(points, leaf_m)), guess, widen=_WIDEN)
        middles.append(found.map_from_scan)
        grid.insert(apply(found.map_from_scan, points))
    return middles


class _Motion:
    """The smooth motion (cubic in position and rotation) through the poses in the middle of scans."""

    def __init__(self, scans: Sequence[Scan], middles: Sequence[Array]) -> None:
        self._t0 = scans[0].end_ns
        t_ns = np.array([_middle(scan) for scan in scans])
        # A step more of the same on either side: a cubic is not to be trusted beyond its ends.
        before = middles[0] @ inverse(middles[1]) @ middles[0]
        after = middles[-1] @ inverse(middles[-2]) @ middles[-1]
        poses = np.stack([before, *middles, after])
        t_ns = np.concatenate([[2 * t_ns[0] - t_ns[1]], t_ns, [2 * t_ns[-1] - t_ns[-2]]])
        seconds = (t_ns - self._t0) * 1e-9
        self._rotation = RotationSpline(seconds, Rotation.from_matrix(poses[:, :3, :3]))
        self._position = CubicSpline(seconds, poses[:, :3, 3])

    def at(self, t_ns: Sequence[int] | NDArray[np.int64]) -> Array:
        """Poses (N, 4, 4)."""
        seconds = (np.asarray(t_ns, dtype=np.int64) - self._t0) * 1e-9
        pose = np.tile(np.eye(4), (len(seconds), 1, 1))
        pose[:, :3, :3], pose[:, :3, 3] = self._rotation(seconds).as_matrix(), self._position(seconds)
        return pose

    def straightened(self, scan: Scan, leaf_m: float) -> Array:
        """Thinned points of a scan at its middle."""
        knots = np.linspace(scan.start_ns, scan.end_ns, _KNOTS).astype(np.int64)
        pose = self.at([*knots, _middle(scan)])
        path = Path(knots, pose[:-1, :3, :3], pose[:-1, :3, 3], np.zeros((_KNOTS, 3)))
        return np.asarray(voxel_means(apply(inverse(pose[-1]) @ pose[-2], scan.at_end(path)), leaf_m))


def straightened(scan: Scan, twist: Array, leaf_m: float) -> Array:
    """Thinned points of a scan at its end, for a rig that turns and moves by twist (6,) a second."""
    knots = np.linspace(scan.start_ns, scan.end_ns, _KNOTS).astype(np.int64)
    pose = np.stack([_moved(twist, (t - scan.end_ns) * 1e-9) for t in knots])
    path = Path(knots, pose[:, :3, :3], pose[:, :3, 3], np.zeros((len(knots), 3)))
    return np.asarray(voxel_means(scan.at_end(path), leaf_m))


def _first_twist(first: Scan, second: Scan, leaf_m: float, planes: PlaneSettings) -> Array:
    seconds = (second.end_ns - first.end_ns) * 1e-9
    best: tuple[Registration, Array] | None = None
    for speed in SPEEDS:
        twist = np.array([0, 0, 0, 0, speed, 0.0])
        for _ in range(2):
            grid = PlaneMap(planes)
            grid.insert(straightened(first, twist, leaf_m / 5))
            points = straightened(second, twist, leaf_m)
            found = grid.register(points, _moved(twist, seconds), iterations=20, widen=_WIDEN)
            twist = _twist(found.map_from_scan, seconds)
        if best is None or found.score > best[0].score:
            best = found, twist
    assert best is not None
    if best[0].score < MIN_SCORE:
        raise CardError(
            "the first scans cannot be registered",
            where=f"scans that end at {first.end_ns} and {second.end_ns} ns",
            found=f"{100 * best[0].score:.0f} % of the points fit",
            wanted=f"at least {100 * MIN_SCORE:.0f} %",
        )
    return best[1]


def _middle(scan: Scan) -> int:
    return (scan.start_ns + scan.end_ns) // 2


def _half(scan: Scan) -> float:
    return (scan.start_ns - scan.end_ns) * 0.5e-9


def _trajectory(t_ns: Sequence[int], poses: Array) -> Trajectory:
    return Trajectory(t_ns, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3]))


def _moved(twist: Array, seconds: float) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(twist[:3] * seconds).as_matrix()
    pose[:3, 3] = twist[3:] * seconds
    return pose


def _twist(step: Array, seconds: float) -> Array:
    turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
    return np.concatenate([turn, step[:3, 3]]) / seconds
