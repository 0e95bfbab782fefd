"""The wheel excitation: where the ground under each wheel is at each time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.wheels.arc_height import RoadPoints
from card.wheels.contact_path import ContactPath
from card.wheels.profile import SplineSettings, fit_profile

Array = NDArray[np.float64]
#: Residual at which Tukey's loss pulls most, by its scale.
GREATEST_PULL = 5**-0.5


@dataclass(frozen=True)
class QualitySettings:
    """When a sample is no good.

    With fewer than `gap_min_points` accepted points within `gap_reach_m` along the path it is a gap; with a
    standard deviation over `max_std_m`, or between two such samples less than a footprint apart, it is
    uncertain. `point_std_m` is that of a point, at the least.
    """

    gap_reach_m: float
    gap_min_points: int
    point_std_m: float
    max_std_m: float


@dataclass(frozen=True)
class Excitation:
    """One wheel's contact with the road at the N trajectory times.

    t_ns : (N,). position : (N, 3) metres in world. points : (N,) accepted LiDAR points near.
    residual_m : (N,) their weighted rms distance from the spline, NaN without points. std_m : (N,) standard
    deviation of the height by the number, place and spread of the points. gap, uncertain : (N,) bool.
    """

    t_ns: NDArray[np.int64]
    position: Array
    points: NDArray[np.int64]
    residual_m: Array
    std_m: Array
    gap: NDArray[np.bool_]
    uncertain: NDArray[np.bool_]

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether each sample (N,) is neither a gap nor uncertain."""
        return ~(self.gap | self.uncertain)

    def at(self, t_ns: ArrayLike) -> tuple[Array, Array]:
        """Contact points (F, 3) at times (F,) within the trajectory, and the greater standard deviation (F,)
        of the samples beside, metres; infinite beside a gap."""
        t = np.asarray(t_ns, dtype=np.int64)
        i = np.clip(np.searchsorted(self.t_ns, t, side="right"), 1, len(self.t_ns) - 1)
        alpha = ((t - self.t_ns[i - 1]) / (self.t_ns[i] - self.t_ns[i - 1]))[:, None]
        position = (1 - alpha) * self.position[i - 1] + alpha * self.position[i]
        std = np.where(self.gap, np.inf, self.std_m)
        return position, np.maximum(std[i - 1], std[i])


def fit_excitation(
    path: ContactPath, road: RoadPoints, spline: SplineSettings, quality: QualitySettings, footprint_m: float
) -> Excitation:
    """The excitation of one wheel from its corridor points: mean heights over a footprint of this length.

    Each run of the path has a spline of its own. It is fitted to the points' elevation, which is their
    height h_p plus that of the path at d_p, rather than to h_p: the road is smooth in arc length, but over a
    body that dives to a stop h_p jumps. A knot's spacing beyond the accepted points of a run the height over
    the path stays as it is; a run without points keeps the rigid path. Both are gaps.
    """
    found = _Samples.unknown(path.position[:, 2].copy())
    for run in np.unique(path.run).tolist():
        segments = np.flatnonzero(path.run == run)
        samples = (path.segment >= segments[0]) & (path.segment <= segments[-1])
        points = road.part(road.run == run)
        if len(points):
            found.put(samples, _fit_run(path, run, path.arc[samples], points, spline, quality, footprint_m))
    std = np.minimum(found.std_m, spline.tukey_m)
    return Excitation(
        path.t_ns,
        _on_the_road(path, found.elevation),
        found.points,
        found.residual_m,
        std,
        found.points < quality.gap_min_points,
        _closed(std > quality.max_std_m, path, footprint_m),
    )


def _closed(uncertain: NDArray[np.bool_], path: ContactPath, footprint_m: float) -> NDArray[np.bool_]:
    """The uncertain samples (N,) of a path and those between two of them less than a footprint apart.

    The standard deviation has a dip at every knot; the footprint there holds the same doubtful points.
    """
    at = np.flatnonzero(uncertain)
    if len(at) in (0, len(uncertain)):
        return uncertain
    following = np.searchsorted(at, np.arange(len(uncertain)))
    before, after = at[np.maximum(following - 1, 0)], at[np.minimum(following, len(at) - 1)]
    run = path.run[path.segment]
    near = (run[before] == run[after]) & (path.arc[after] - path.arc[before] < footprint_m)
    between = (following > 0) & (following < len(at))
    return uncertain | (between & near)


@dataclass(frozen=True)
class _Samples:
    """The road's elevation, accepted points near, their residual and the standard deviation, (S,) each."""

    elevation: Array
    points: NDArray[np.int64]
    residual_m: Array
    std_m: Array

    @classmethod
    def unknown(cls, elevation: Array) -> "_Samples":
        """Samples without points, at these elevations (S,)."""
        count = len(elevation)
        return cls(elevation, np.zeros(count, dtype=np.int64), np.full(count, np.nan), np.full(count, np.inf))

    def put(self, where: NDArray[np.bool_], part: "_Samples") -> None:
        for name in ("elevation", "points", "residual_m", "std_m"):
            getattr(self, name)[where] = getattr(part, name)


def _fit_run(
    path: ContactPath,
    run: int,
    at: Array,
    road: RoadPoints,
    spline: SplineSettings,
    quality: QualitySettings,
    footprint_m: float,
) -> _Samples:
    """The samples at arc lengths (S,) of a run, from its points."""
    road = road.part(np.argsort(road.arc, kind="stable"))
    base = path.elevation(road.arc, run)
    profile, error, weight = fit_profile(road.arc, road.sideways, road.height + base, spline, guess=base)
    accepted = np.flatnonzero(weight > 0)
    if len(accepted) == 0:
        return _Samples.unknown(path.elevation(at, run))
    near = _Near(road.arc[accepted], at, quality.gap_reach_m)
    # A point that the fit refused speaks against it as loudly as one that pulls at it most, but no louder:
    # a speck of dust among eighty points does not make them doubtful.
    loudest = GREATEST_PULL * spline.tukey_m
    spread = _Near(road.arc, at, quality.gap_reach_m).rms(
        np.ones(len(error)), np.clip(error, -loudest, loudest)
    )
    ends = road.arc[accepted[0]] - spline.knot_spacing_m, road.arc[accepted[-1]] + spline.knot_spacing_m
    nearest = np.clip(at, *ends)
    return _Samples(
        profile.under(nearest, footprint_m) - path.elevation(nearest, run) + path.elevation(at, run),
        near.count,
        near.rms(weight[accepted], error[accepted]),
        np.fmax(spread, quality.point_std_m) * profile.std_under(nearest, footprint_m),
    )


def _on_the_road(path: ContactPath, elevation: Array) -> Array:
    """Contact points (N, 3): each pose's own, slid along the rig's z to the road's elevation (N,).

    That elevation is fixed to the world, so a body that dives or rolls while the car stands moves its
    contact path but not the result.
    """
    up = path.rotation[:, :, 2]
    return path.position + ((elevation - path.position[:, 2]) / up[:, 2])[:, None] * up


class _Near:
    """The points, sorted by arc length (Q,), within a reach of samples at arc lengths (S,)."""

    def __init__(self, arc: Array, at: Array, reach_m: float) -> None:
        self._first = np.searchsorted(arc, at - reach_m, side="left")
        self._last = np.searchsorted(arc, at + reach_m, side="right")

    @property
    def count(self) -> NDArray[np.int64]:
        """How many there are (S,)."""
        return (self._last - self._first).astype(np.int64)

    def rms(self, weight: Array, value: Array) -> Array:
        """Their weighted root mean square (S,), NaN without points."""
        total = np.concatenate([[0.0], np.cumsum(weight)])
        squares = np.concatenate([[0.0], np.cumsum(weight * value**2)])
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = (squares[self._last] - squares[self._first]) / (total[self._last] - total[self._first])
        return np.where(self.count > 0, np.sqrt(np.maximum(mean, 0.0)), np.nan)
