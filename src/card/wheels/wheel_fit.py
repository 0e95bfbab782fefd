"""The wheel excitation: where the ground under each wheel is at each time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.wheels.contact_path import ContactPath
from card.wheels.profile import SplineSettings, fit_profile

Array = NDArray[np.float64]


@dataclass(frozen=True)
class GapSettings:
    """A sample with fewer than `min_points` accepted points within `reach_m` along the path is a gap."""

    reach_m: float
    min_points: int


@dataclass(frozen=True)
class Excitation:
    """One wheel's contact with the road at the N trajectory times.

    t_ns : (N,). position : (N, 3) metres in world. points : (N,) accepted LiDAR points near.
    residual_m : (N,) their weighted rms distance from the spline, NaN without points. gap : (N,) bool.
    """

    t_ns: NDArray[np.int64]
    position: Array
    points: NDArray[np.int64]
    residual_m: Array
    gap: NDArray[np.bool_]

    def at(self, t_ns: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Contact points (F, 3) at times (F,) within the trajectory, and whether a gap is beside."""
        t = np.asarray(t_ns, dtype=np.int64)
        i = np.clip(np.searchsorted(self.t_ns, t, side="right"), 1, len(self.t_ns) - 1)
        alpha = ((t - self.t_ns[i - 1]) / (self.t_ns[i] - self.t_ns[i - 1]))[:, None]
        position = (1 - alpha) * self.position[i - 1] + alpha * self.position[i]
        return position, self.gap[i - 1] | self.gap[i]


def fit_excitation(
    path: ContactPath, arc: Array, height: Array, spline: SplineSettings, gaps: GapSettings
) -> Excitation:
    """The excitation of one wheel from the arc lengths and heights (Q,) of its corridor points, metres.

    Each run of the path has a spline of its own. It is fitted to the points' elevation, which is their
    height h_p plus that of the path at d_p, rather than to h_p: the road is smooth in arc length, but over a
    body that dives to a stop h_p jumps. A knot's spacing beyond the accepted points of a run the height over
    the path stays as it is; a run without points keeps the rigid path. Both are gaps.
    """
    lift = np.zeros(len(path.t_ns))
    points = np.zeros(len(path.t_ns), dtype=np.int64)
    residual = np.full(len(path.t_ns), np.nan)
    for run in np.unique(path.run):
        segments = np.flatnonzero(path.run == run)
        samples = (path.segment >= segments[0]) & (path.segment <= segments[-1])
        inside = (arc >= path.knot_arc[segments[0]]) & (arc <= path.knot_arc[segments[-1] + 1])
        if inside.any():
            lift[samples], points[samples], residual[samples] = _fit_run(
                path, path.arc[samples], arc[inside], height[inside], spline, gaps.reach_m
            )
    position = _on_the_road(path, lift)
    return Excitation(path.t_ns, position, points, residual, points < gaps.min_points)


def _fit_run(
    path: ContactPath, at: Array, arc: Array, height: Array, spline: SplineSettings, reach_m: float
) -> tuple[Array, NDArray[np.int64], Array]:
    """Height over the path, accepted points near and their residual at arc lengths (S,) of a run, from its
    points (Q,)."""
    order = np.argsort(arc, kind="stable")
    arc, height = arc[order], height[order]
    base = path.elevation(arc)
    profile, weight = fit_profile(arc, height + base, spline, guess=base)
    accepted = weight > 0
    if not accepted.any():
        return np.zeros(len(at)), np.zeros(len(at), dtype=np.int64), np.full(len(at), np.nan)
    arc, weight, error = arc[accepted], weight[accepted], (height + base - profile.at(arc))[accepted]
    points, residual = _quality(at, arc, error, weight, reach_m)
    nearest = np.clip(at, arc[0] - spline.knot_spacing_m, arc[-1] + spline.knot_spacing_m)
    return profile.at(nearest) - path.elevation(nearest), points, residual


def _on_the_road(path: ContactPath, height: Array) -> Array:
    """Contact points (N, 3): each pose's own, slid along the rig's z to the elevation of its arc length.

    That elevation is fixed to the world, so a body that dives or rolls while the car stands moves its
    contact path but not the result.
    """
    up = path.rotation[:, :, 2]
    rise = path.surface(path.arc, height)[:, 2] - path.position[:, 2]
    return path.position + (rise / up[:, 2])[:, None] * up


def _quality(
    at: Array, arc: Array, residual: Array, weight: Array, reach_m: float
) -> tuple[NDArray[np.int64], Array]:
    first = np.searchsorted(arc, at - reach_m, side="left")
    last = np.searchsorted(arc, at + reach_m, side="right")
    total = np.concatenate([[0.0], np.cumsum(weight)])
    squares = np.concatenate([[0.0], np.cumsum(weight * residual**2)])
    points = (last - first).astype(np.int64)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (squares[last] - squares[first]) / (total[last] - total[first])
    return points, np.where(points > 0, np.sqrt(np.maximum(mean, 0.0)), np.nan)
