"""Odometry from scans alone, for the start of a drive and for checks of the IMU: it trusts no IMU at all."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

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
_KNOTS = 11
_WIDEN = 10.0


def scan_trajectory(
    scans: Sequence[Scan], leaf_m: float, planes: PlaneSettings
) -> tuple[Trajectory, Trajectory]:
    """Poses of the rig at the ends, and in the middle, of two scans or more, in the frame of the first end.

    The middle is what a scan tells best: its end follows from there by the constant velocity, and lags where
    the car speeds up or turns in.

    Scans are straightened with the constant turn and velocity that the last two poses tell of, and again with
    those that come out (as I. Vizzo et al., "KISS-ICP", RA-L 2023).

    Raises
    ------
    CardError
        If the first two scans cannot be registered at any speed of a car.
    """
    twist = _first_twist(scans[0], scans[1], leaf_m, planes)
    first = _run(scans, [twist], leaf_m, planes)
    # A step's twist is that of its middle, half a scan before the scan's own: take it from both neighbours.
    steps = np.stack([twist, *first.twists[1:], first.twists[-1]])
    second = _run(scans, list(0.5 * (steps[:-1] + steps[1:])), leaf_m, planes)
    middles = [
        pose @ _moved(t, _half(s)) for pose, t, s in zip(second.poses, second.twists, scans, strict=True)
    ]
    ends = [scan.end_ns for scan in scans]
    return (
        _trajectory(ends, second.poses),
        _trajectory([(scan.start_ns + scan.end_ns) // 2 for scan in scans], middles),
    )


@dataclass(frozen=True)
class _Pass:
    """poses at the scans' ends, and the twists: of the steps to them, or as given."""

    poses: list[Array]
    twists: list[Array]


def _run(scans: Sequence[Scan], given: list[Array], leaf_m: float, planes: PlaneSettings) -> _Pass:
    """Register scan by scan, straightened by given twists, or by those that come out if only the first is."""
    poses, twists = [np.eye(4)], [given[0]]
    grid = PlaneMap(planes, horizon=60)
    grid.insert(straightened(scans[0], given[0], leaf_m / 5))
    for k, (before, scan) in enumerate(pairwise(scans), 1):
        seconds = (scan.end_ns - before.end_ns) * 1e-9
        known = len(given) > 1
        twist = given[k] if known else twists[-1]
        for _ in range(1 if known else 2):
            points = straightened(scan, twist, leaf_m)
            found = grid.register(points, poses[-1] @ _moved(twist, seconds), widen=_WIDEN)
            twist = twist if known else _twist(inverse(poses[-1]) @ found.map_from_scan, seconds)
        poses.append(found.map_from_scan)
        twists.append(twist)
        grid.insert(apply(found.map_from_scan, straightened(scan, twist, leaf_m / 5)))
    return _Pass(poses, twists)


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


def _half(scan: Scan) -> float:
    return (scan.start_ns - scan.end_ns) * 0.5e-9


def _trajectory(t_ns: Sequence[int], poses: Sequence[Array]) -> Trajectory:
    stack = np.stack(poses)
    return Trajectory(t_ns, stack[:, :3, 3], quaternion_from_matrix(stack[:, :3, :3]))


def _moved(twist: Array, seconds: float) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec(twist[:3] * seconds).as_matrix()
    pose[:3, 3] = twist[3:] * seconds
    return pose


def _twist(step: Array, seconds: float) -> Array:
    turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
    return np.concatenate([turn, step[:3, 3]]) / seconds
