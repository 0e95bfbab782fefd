"""LiDAR-inertial odometry, scan by scan."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.artifacts import progress
from card.errors import CardError
from card.estimation.imu import Imu, ImuNoise
from card.estimation.lidar_only import scan_trajectory
from card.estimation.plane_kernels import voxel_means
from card.estimation.plane_map import PlaneMap, PlaneSettings, Registration
from card.estimation.scans import Scan, Sweeps
from card.estimation.smoother import Smoother, State
from card.estimation.start import SIGMAS, start_state
from card.estimation.strapdown import Path, integrate
from card.geometry import apply, inverse

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Step:
    """The odometry at the end of one sweep.

    scan : ordinal among the sweeps.  found : the registration; None where it failed.
    """

    scan: int
    state: State
    found: Registration | None


def plane_settings(settings: Mapping[str, Any]) -> PlaneSettings:
    """The map's part of the stage's settings."""
    return PlaneSettings(
        leaf_m=settings["map_leaf_m"],
        min_points=settings["min_plane_points"],
        max_thickness_m=settings["max_plane_thickness_m"],
        sigma_m=settings["plane_sigma_m"],
        kernel_sigmas=settings["kernel_sigmas"],
    )


def run_odometry(scans: Sweeps, imu: Imu, settings: Mapping[str, Any]) -> list[Step]:
    """Poses, velocities and biases at the end of every sweep that the IMU covers.

    Raises
    ------
    CardError
        If the IMU covers fewer than three sweeps, or the first ones cannot be registered.
    """
    covered = covered_sweeps(scans, imu)
    first = int(covered[0])
    same = [int(i) for i in covered if scans.lidar[i] == scans.lidar[first]]
    until = scans.end_ns[first] + settings["start_s"] * 1e9
    opening = [scans[i] for i in same[:2] + [i for i in same[2:] if scans.end_ns[i] <= until]]
    planes = plane_settings(settings)
    path, _ = scan_trajectory(opening, settings["scan_leaf_m"], planes)
    start = rehearsed(opening, start_state(imu, path, settings["gravity_m_s2"]), imu, settings)
    odometry = Odometry(start, imu, settings)
    odometry.begin(opening[0])
    steps = [Step(first, odometry.states[-1], None)]
    rest = [int(i) for i in covered[1:]]
    for i, scan in scans.ahead(progress(rest, "odometry")):
        if scan.end_ns > odometry.states[-1].t_ns:
            steps.append(Step(i, *odometry.add(scan)))
    return steps


def rehearsed(opening: Sequence[Scan], start: State, imu: Imu, settings: Mapping[str, Any]) -> State:
    """The start as the opening's scans and IMU together tell of it, from a poorer one.

    Where the car starts in motion on a rough road, scans alone leave the velocity off by decimetres a second,
    and the first scans would enter the map bent.
    """
    odometry = Odometry(start, imu, {**settings, "lag_s": np.inf})
    odometry.begin(opening[0])
    for scan in opening[1:]:
        odometry.add(scan)
    return odometry.smoothed_start()


def covered_sweeps(scans: Sweeps, imu: Imu) -> NDArray[np.intp]:
    """Ordinals of the sweeps within the time of the IMU.

    Raises
    ------
    CardError
        If they are fewer than three.
    """
    covered = np.flatnonzero((scans.start_ns >= imu.t_ns[0]) & (scans.end_ns <= imu.t_ns[-1]))
    if len(covered) < 3:
        raise CardError(
            "IMU covers too few sweeps",
            found=f"{len(covered)} within {imu.t_ns[0]}..{imu.t_ns[-1]} ns",
            wanted="at least 3",
        )
    return covered


class Odometry:
    """The local map and the smoother.  states : those a sweep may still reach back to, the latest last."""

    def __init__(self, start: State, imu: Imu, settings: Mapping[str, Any]) -> None:
        self._imu, self._settings = imu, settings
        self._noise = ImuNoise.from_settings(settings)
        self._smoother = Smoother(start, SIGMAS, self._noise, settings["lag_s"])
        self._map = PlaneMap(plane_settings(settings), horizon=settings["map_horizon"])
        self._keyframe = start.pose
        self.states = [start]

    def begin(self, scan: Scan) -> None:
        """Start the map with the sweep that ends at the first state, whose motion goes back from there."""
        back = self._imu.between(scan.start_ns, scan.end_ns).backwards()
        path = self._integrate(back, self.states[0]).backwards()
        self._insert(scan.at_end(path), self.states[0].pose)

    def add(self, scan: Scan) -> tuple[State, Registration | None]:
        """Take a sweep that ends after the last state."""
        settings, last = self._settings, self.states[-1]
        ahead = self._integrate(self._imu.between(last.t_ns, scan.end_ns), last)
        points = scan.at_end(self._during(scan, last, ahead))
        thinned = voxel_means(points, settings["scan_leaf_m"])
        found: Registration | None = self._map.register(thinned, ahead.pose[-1])
        assert found is not None
        if found.inlier_fraction < settings["min_inlier_fraction"]:
            found = None
        state = self._smoother.add(
            self._imu.between(last.t_ns, scan.end_ns),
            ahead.pose[-1],
            ahead.velocity[-1],
            ahead.pose[-1] if found is None else found.map_from_scan,
            None if found is None else found.information / settings["registration_inflation"] ** 2,
        )
        self.states = [*self.states[-4:], state]
        if self._moved(state.pose):
            self._insert(points, state.pose)
        return state, found

    def smoothed_start(self) -> State:
        """The first state, as all scans since then tell of it: nothing may have left the lag."""
        return self._smoother.first()

    def _during(self, scan: Scan, last: State, ahead: Path) -> Path:
        """The motion from a state before the sweep's start to its end."""
        if last.t_ns <= scan.start_ns:
            return ahead
        earlier = [state for state in self.states if state.t_ns <= scan.start_ns]
        base = earlier[-1] if earlier else self.states[0]
        return self._integrate(self._imu.between(base.t_ns, scan.end_ns), base)

    def _integrate(self, imu: Imu, state: State) -> Path:
        unbiased = imu.without(state.gyro_bias, state.accel_bias)
        return integrate(unbiased, state.pose, state.velocity, state.gravity)

    def _moved(self, pose: Array) -> bool:
        """Whether the map gains from this sweep: at standstill more of the same would only wear it out."""
        step = inverse(self._keyframe) @ pose
        turn = Rotation.from_matrix(step[:3, :3]).magnitude()
        far = np.linalg.norm(step[:3, 3]) > self._settings["keyframe_m"]
        return bool(far or turn > np.radians(self._settings["keyframe_deg"]))

    def _insert(self, points: Array, pose: Array) -> None:
        self._map.insert(apply(pose, voxel_means(points, self._settings["map_points_leaf_m"])))
        self._keyframe = pose
