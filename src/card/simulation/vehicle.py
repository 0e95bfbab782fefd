"""How the car moves: along its lane, on its wheels, its body on springs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, quaternion_from_matrix
from card.simulation.footprint import footprint_height
from card.simulation.rig import FRONT_AXLE_Y_M, HALF_TRACK_M, REAR_AXLE_Y_M, RIG_HEIGHT_M
from card.simulation.road import Road
from card.simulation.suspension import HEAVE, PITCH, ROLL, levelled, sag, sprung

Array = NDArray[np.float64]

RATE_HZ = 1000
#: The car is simulated this much longer at both ends: its springs have settled when the recording starts.
MARGIN_S = 2.0
_SMOOTHING_S = 0.15
_PROFILE_STEP_M = 0.025
#: Lean of the body in braking and in bends, rad per m/s^2, and the weight's share on a slope.
_DIVE, _LEAN, _GRAVITY_M_S2 = 0.004, 0.006, 9.81
#: How long a load takes to get in, s.
_BOARDING_S = 1.5
_WHEELS_XY = np.array([[x * HALF_TRACK_M, y] for y in (FRONT_AXLE_Y_M, REAR_AXLE_Y_M) for x in (-1, 1)])


@dataclass(frozen=True)
class Course:
    """Where along the road the car is: arc length s (N,) m at times t (N,) s, RATE_HZ apart."""

    t: Array
    s: Array

    def at(self, t: float) -> float:
        """Arc length at time ``t`` (s)."""
        return float(np.interp(t, self.t, self.s))


@dataclass(frozen=True)
class Lane:
    """The offset the driver keeps (m, right positive), with a slow weave."""

    offset: float
    weave: float
    wavelength: float
    phase: float

    def at(self, s: Array, derivative: int = 0) -> Array:
        """Offset or its first derivative at arc lengths."""
        k = 2 * np.pi / self.wavelength
        if derivative:
            return self.weave * k * np.cos(k * s + self.phase)
        return self.offset + self.weave * np.sin(k * s + self.phase)


def course(speeds: list[tuple[float, float]], start_s: float, duration_s: float) -> Course:
    """The course of a speed profile given as knots (t in s, v in m/s), its corners rounded a little."""
    from scipy.interpolate import PchipInterpolator
    from scipy.ndimage import gaussian_filter1d

    count = round((duration_s + 2 * MARGIN_S) * RATE_HZ) + 1
    t = np.arange(count) / RATE_HZ - MARGIN_S
    knots_t, knots_v = np.array(speeds).T
    v = PchipInterpolator(knots_t, knots_v)(np.clip(t, knots_t[0], knots_t[-1]))
    v = gaussian_filter1d(v, _SMOOTHING_S * RATE_HZ, mode="nearest")
    travelled = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2) / RATE_HZ])
    return Course(t, start_s + travelled - np.interp(0.0, t, travelled))


@dataclass(frozen=True)
class Load:
    """A mass (kg) that gets in at ``time`` (s of the course) at (x, y) in ``rig``, m."""

    time: float
    mass_kg: float
    x_m: float
    y_m: float


def ride(road: Road, lane: Lane, where: Course, start_ns: int, loads: tuple[Load, ...] = ()) -> Trajectory:
    """``world_from_rig`` at RATE_HZ of the car on its course; time 0 of the course is ``start_ns``.

    The body follows the plane through its wheels as far as the springs let it. Slopes, bends, braking and
    ``loads`` deflect them; the air suspension takes that back in its own time.
    """
    s = np.arange(where.s[0] - 1.0, where.s[-1] + 1.0, _PROFILE_STEP_M)
    xy, forward = _track(road, lane, s)
    right = np.stack([forward[:, 1], -forward[:, 0]], axis=1)
    under = np.stack(
        [footprint_height(road, xy + x * right + y * forward, forward, s + y) for x, y in _WHEELS_XY],
        axis=1,
    )
    # The plane through four contacts: height at the rig's origin, slope to the right, slope ahead.
    plane = under @ np.linalg.pinv(np.column_stack([np.ones(4), _WHEELS_XY])).T
    from scipy.interpolate import CubicSpline

    height, across, ahead = CubicSpline(s, plane)(where.s).T
    xy, forward = _track(road, lane, where.s)
    velocity = np.gradient(xy, where.t, axis=0)
    acceleration = np.gradient(velocity, where.t, axis=0)
    left = np.stack([-forward[:, 1], forward[:, 0]], axis=1)
    # Uphill is like accelerating, a slope to the left like a bend to the right.
    dive = _DIVE * (np.sum(acceleration * forward, axis=1) + _GRAVITY_M_S2 * ahead)
    lean = -_LEAN * (np.sum(acceleration * left, axis=1) - _GRAVITY_M_S2 * across)
    sags = _sags(loads, where.t)
    height, across, ahead = (
        sprung(ground + levelled(spring, 1.0 / RATE_HZ), mode, 1.0 / RATE_HZ)
        for ground, spring, mode in (
            (height, sags[0], HEAVE),
            (across, sags[1] + lean, ROLL),
            (ahead, sags[2] + dive, PITCH),
        )
    )
    rotation = _upright_on(forward, across, ahead)
    z = height + RIG_HEIGHT_M / rotation[:, 2, 2]
    t_ns = start_ns + np.round(where.t * RATE_HZ).astype(np.int64) * (1_000_000_000 // RATE_HZ)
    return Trajectory(t_ns, np.column_stack([xy, z]), quaternion_from_matrix(rotation))


def _sags(loads: tuple[Load, ...], t: Array) -> Array:
    """Static heave (m) and slopes to the right and ahead (3, N) under what has got in by times (N,)."""
    total = np.zeros((3, len(t)))
    for load in loads:
        share = np.clip((t - load.time) / _BOARDING_S, 0.0, 1.0)
        total += np.array(sag(load.mass_kg, load.x_m, load.y_m))[:, None] * share
    return total


def _track(road: Road, lane: Lane, s: Array) -> tuple[Array, Array]:
    """Path of the rig's origin (N, 2) in world and its direction (N, 2)."""
    d, slope = lane.at(s), lane.at(s, 1)
    tangent, bend = road.line.at(s, 1), road.line.at(s, 2)
    right = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
    turn = np.stack([bend[:, 1], -bend[:, 0]], axis=1)
    direction = tangent + slope[:, None] * right + d[:, None] * turn
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rotation = road.world_from_map[:2, :2]
    xy = road.line.offset(s, d) @ rotation.T + road.world_from_map[:2, 3]
    return xy, direction @ rotation.T


def _upright_on(forward: Array, across: Array, ahead: Array) -> Array:
    """Rotations (N, 3, 3) of a body whose floor slopes by ``across`` to the right and ``ahead`` ahead."""
    right = np.stack([forward[:, 1], -forward[:, 0]], axis=1)
    up = np.column_stack([-across[:, None] * right - ahead[:, None] * forward, np.ones(len(forward))])
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    y = np.column_stack([forward, ahead])
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, up), y, up], axis=2)
