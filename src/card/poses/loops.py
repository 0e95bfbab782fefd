"""Loop closures: places that the drive comes back to, found by radius and proved by registration."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.estimation.batch import Between
from card.estimation.plane_kernels import voxel_means
from card.estimation.plane_map import PlaneMap, PlaneSettings, Registration
from card.geometry import apply, inverse
from card.poses.sweep_store import SweepStore

Array = NDArray[np.float64]
#: A kernel this many times wider takes a guess some decimetres off.
WIDEN = 10.0


@dataclass(frozen=True)
class Loop:
    """A proved or refused return from node `first` to `second`, later by a whole round.

    found : the registration of the second node's sweep in the map around the first.
    inlier_fraction : share of the sweep's points on known planes that fit them.
    accepted : whether it passed the checks of the registration.
    """

    first: int
    second: int
    found: Registration
    inlier_fraction: float
    accepted: bool

    def between(self, inflation: float) -> Between:
        """As a relative pose for the graph."""
        return Between(
            self.first, self.second, self.found.map_from_scan, self.found.information / inflation**2
        )


def travelled(poses: Array) -> Array:
    """Way (N,) in metres up to each of the poses (N, 4, 4)."""
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def spaced(way: Array, spacing_m: float) -> NDArray[np.intp]:
    """Nodes (M,) from the first on that are at least so far apart along their way (N,)."""
    chosen = [0]
    for k in range(1, len(way)):
        if way[k] - way[chosen[-1]] >= spacing_m:
            chosen.append(k)
    return np.array(chosen, dtype=np.intp)


def candidates(
    poses: Array, spacing_m: float, radius_m: float, min_way_m: float, drift_share: float = 0.0
) -> list[tuple[int, int]]:
    """Pairs (earlier, later) of poses (N, 4, 4) that lie within a radius, the later ones `spacing_m` apart.

    Of the first and the last earlier pass through the radius the nearest node counts; passes are runs of
    nodes in a row. More passes would say little more, and a drive of many rounds would have too many.

    drift_share : by which share of the way between two poses the radius grows. Then only the last pass
        counts, to which least has drifted.
    """
    way, position = travelled(poses), poses[:, :3, 3]
    pairs = []
    last = -np.inf
    for later in range(len(position)):
        if way[later] - last < spacing_m:
            continue
        earlier = np.flatnonzero(way < way[later] - min_way_m)
        distance = np.linalg.norm(position[earlier] - position[later], axis=1)
        inside = np.flatnonzero(distance < radius_m + drift_share * (way[later] - way[earlier]))
        if not len(inside):
            continue
        last = way[later]
        runs = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1)
        for run in runs[-1:] if drift_share else runs[:1] + runs[1:][-1:]:
            pairs.append((int(earlier[run[np.argmin(distance[run])]]), later))
    return pairs


class LoopVerifier:
    """Registers later sweeps in maps of the sweeps around earlier nodes."""

    def __init__(self, store: SweepStore, planes: PlaneSettings, settings: Mapping[str, Any]) -> None:
        self._store, self._planes, self._settings = store, planes, settings
        self._map: tuple[int, PlaneMap] | None = None

    def verify(self, poses: Array, first: int, second: int, drift_m: float) -> Loop:
        """Prove that `second` came back to `first`.

        drift_m : how far the nodes' relative position may be wrong. Beyond a metre, places on a grid as wide
        are tried and the best wins: a street seen along itself fits almost everywhere.
        """
        return self.verify_at(poses, first, second, inverse(poses[first]) @ poses[second], drift_m)

    def verify_at(self, poses: Array, first: int, second: int, guess: Array, drift_m: float = 0.0) -> Loop:
        """Prove that `second` lies at about `guess` (4, 4) in the frame of `first`; see `verify`."""
        grid, leaf = self._map_around(poses, first), self._settings["scan_leaf_m"]
        points = np.asarray(voxel_means(self._store.points(second), leaf))
        if drift_m > 1.0:
            guess = self._search(grid, points, guess, drift_m)
        found = grid.register(points, guess, iterations=30, widen=WIDEN)
        fraction = found.inlier_fraction / max(found.known_fraction, 1e-9)
        accepted = (
            fraction >= self._settings["loop_inlier_fraction"]
            and found.known_fraction >= self._settings["loop_known_fraction"]
            and float(np.linalg.eigvalsh(found.information)[0]) > 1.0 / self._settings["loop_sigma"] ** 2
        )
        return Loop(first, second, found, fraction, accepted)

    def _search(self, grid: PlaneMap, points: Array, guess: Array, drift_m: float) -> Array:
        """The best of many starts; both passes are on the road, so neither height nor tilt is searched."""
        coarse = np.asarray(voxel_means(points, 2 * self._settings["scan_leaf_m"]))
        yaw = np.arctan2(guess[1, 0] - guess[0, 1], guess[0, 0] + guess[1, 1])
        level = np.eye(4)
        level[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        step = self._settings["loop_search_m"]
        reach = np.arange(-np.ceil(drift_m / step), np.ceil(drift_m / step) + 1) * step
        best: Registration | None = None
        for x in reach:
            for y in reach:
                level[:3, 3] = guess[0, 3] + x, guess[1, 3] + y, 0.0
                found = grid.register(coarse, level, iterations=16, widen=WIDEN)
                if best is None or found.score > best.score:
                    best = found
        assert best is not None
        return best.map_from_scan

    def _map_around(self, poses: Array, first: int) -> PlaneMap:
        """Planes of the sweeps within reach along the way, in the first node's frame."""
        if self._map is None or self._map[0] != first:
            way = travelled(poses)
            # Nothing of the later visit may get into the map of the earlier one.
            reach = min(self._settings["loop_map_m"], self._settings["loop_min_way_m"] / 2)
            grid = PlaneMap(self._planes)
            # The same sweeps for the maps of all loops: most of the work is to read them.
            chosen = spaced(way, self._settings["loop_map_spacing_m"])
            for k in chosen[np.abs(way[chosen] - way[first]) <= reach]:
                relative = inverse(poses[first]) @ poses[k]
                grid.insert(apply(relative, self._store.points(int(k))))
            self._map = first, grid
        return self._map[1]
