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

    Beyond the first and last accepted point the profile keeps its last height; without any point the rigid
    path itself comes back. Both are gaps.
    """
    if len(arc) == 0:
        none = np.zeros(len(path.t_ns), dtype=np.int64)
        return Excitation(path.t_ns, path.position, none, np.full(len(none), np.nan), none == 0)
    profile, weight = fit_profile(arc, height, spline)
    accepted = weight > 0
    order = np.argsort(arc[accepted], kind="stable")
    arc, height, weight = (values[accepted][order] for values in (arc, height, weight))
    points, residual = _quality(path.arc, arc, height - profile.at(arc), weight, gaps.reach_m)
    nearest = np.clip(path.arc, arc[0], arc[-1]) if len(arc) else path.arc
    return Excitation(
        path.t_ns,
        _on_the_road(path, profile.at(nearest)),
        points,
        residual,
        points < gaps.min_points,
    )


def _on_the_road(path: ContactPath, height: Array) -> Array:
    """Contact points (N, 3): each pose's own, raised along the rig's z to the surface at its arc length.

    The surface is fixed to the world, so a body that dives or rolls while the car stands moves its contact
    path but not the result.
    """
    up = path.rotation[:, :, 2]
    lift = np.einsum("ij,ij->i", up, path.surface(path.arc, height) - path.position)
    return path.position + lift[:, None] * up


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
