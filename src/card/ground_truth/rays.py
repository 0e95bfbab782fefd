"""The rays of one sweep, found by the places they pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

#: Poses a sweep is divided into.
POSES = 256
_AZIMUTH_BINS = 2048
#: Rounds after which the search for the pose that saw a place gives up; a place beside the car takes most.
_ROUNDS = 10
#: Rays this close to the cut at +-pi are listed on both sides of it.
_WRAP_RAD = 0.3
#: Azimuths of one ring, those listed twice included, lie within this much of one another.
_RING_STRIDE = 4 * np.pi


@dataclass(frozen=True)
class Passes:
    """Rays that pass close to places and return beyond them, a row for each pair.

    place, ray: (K,) which. along: (K,) metres from the ray's origin to its point nearest to the place.
    beyond: (K,) metres from there to the ray's return. direction: (K, 3) unit vectors, world.
    gap: (K, 3) metres, from the place to the return.
    """

    place: Index
    ray: Index
    along: Floats
    beyond: Floats
    direction: Floats
    gap: Floats


def pose_times(start_ns: int, end_ns: int) -> npt.NDArray[np.int64]:
    """Times (POSES,) evenly spaced over a sweep, both ends included."""
    # As offsets: float64 does not resolve nanoseconds since 1970.
    return start_ns + np.rint(np.linspace(0, end_ns - start_ns, POSES)).astype(np.int64)


class SweepRays:
    """The rays of a sweep from where the moving sensor fired them to their returns.

    Parameters
    ----------
    points : (N, 3) returns in world, metres. time_ns, ring : (N,) firing times and channels.
    pose_ns : (M,) evenly spaced times over the sweep, about one turn of the head.
    poses : (M, 4, 4) world_from_lidar at them.
    """

    def __init__(
        self,
        points: Floats,
        time_ns: npt.NDArray[np.int64],
        ring: npt.NDArray[np.uint8],
        pose_ns: npt.NDArray[np.int64],
        poses: Floats,
    ) -> None:
        self._rotations, self._translations = poses[:, :3, :3], poses[:, :3, 3]
        # Metres and radians the sensor moves at most from one pose to the next, and a radian of its spin.
        self._step_m = np.linalg.norm(np.diff(self._translations, axis=0), axis=1).max()
        self._step_rad = np.linalg.norm(np.diff(self._rotations, axis=0), axis=(1, 2)).max() / np.sqrt(2)
        self._poses_a_rad = (len(pose_ns) - 1) / (2 * np.pi)
        at = (time_ns - pose_ns[0]) / max(int(pose_ns[-1] - pose_ns[0]), 1) * (len(pose_ns) - 1)
        low = np.minimum(at.astype(np.int64), len(pose_ns) - 2)
        share = (at - low)[:, None]
        self.origins = (1 - share) * self._translations[low] + share * self._translations[low + 1]
        rays = points - self.origins
        self.lengths = np.linalg.norm(rays, axis=1)
        self.directions = rays / self.lengths[:, None]
        nearest = np.rint(at).astype(np.int64)
        fired = np.einsum("nji,nj->ni", self._rotations[nearest], points - self._translations[nearest])
        azimuth = np.arctan2(fired[:, 0], fired[:, 1])
        elevation = np.arctan2(fired[:, 2], np.hypot(fired[:, 0], fired[:, 1]))
        # When the spinning head looked in a direction: a voxel there was seen with the pose of that time.
        bins = (np.arange(_AZIMUTH_BINS) + 0.5) / _AZIMUTH_BINS * 2 * np.pi - np.pi
        self._pose_at = np.rint(np.interp(bins, azimuth, at, period=2 * np.pi)).astype(np.int64)
        self._index_rings(ring, azimuth, elevation)

    def _index_rings(self, ring: npt.NDArray[np.uint8], azimuth: Floats, elevation: Floats) -> None:
        rings, number = np.unique(ring, return_inverse=True)
        low = np.array([elevation[number == k].min() for k in range(len(rings))])
        high = np.array([elevation[number == k].max() for k in range(len(rings))])
        self._ring_low, self._ring_high = low, high
        wraps = np.abs(azimuth) > np.pi - _WRAP_RAD
        ray = np.r_[np.arange(len(azimuth)), np.flatnonzero(wraps)]
        angle = np.r_[azimuth, azimuth[wraps] - np.sign(azimuth[wraps]) * 2 * np.pi]
        place = number[ray] * _RING_STRIDE + angle
        order = np.argsort(place, kind="stable")
        self._sorted, self._ray = place[order], ray[order]

    def passing(
        self, places: Floats, lateral: float, nearest: float, furthest: float, beyond: float
    ) -> Passes:
        """All rays that pass within `lateral` of a place and return at least `beyond` behind it, metres.

        Parameters
        ----------
        places : (P, 3) world, metres.
        nearest, furthest : bounds of the distance along the ray, metres.
        """
        place, ray = self._candidates(places, lateral, nearest, furthest)
        offset = places[place] - self.origins[ray]
        along = np.einsum("ni,ni->n", offset, self.directions[ray])
        aside = np.einsum("ni,ni->n", offset, offset) - along**2
        left = self.lengths[ray] - along
        ok = (aside <= lateral**2) & (along >= nearest) & (along <= furthest) & (left >= beyond)
        place, ray = place[ok], ray[ok]
        gap = self.directions[ray] * self.lengths[ray][:, None] - offset[ok]
        return Passes(place, ray, along[ok], left[ok], self.directions[ray], gap)

    def _candidates(
        self, places: Floats, lateral: float, nearest: float, furthest: float
    ) -> tuple[Index, Index]:
        """Pairs (place, ray) that hold all within `lateral`; the exact test is the caller's."""
        fired = self._seen_by_sensor(places)
        flat = np.hypot(fired[:, 0], fired[:, 1])
        distance = np.hypot(flat, fired[:, 2])
        elevation = np.arctan2(fired[:, 2], flat)
        reach = lateral + 2 * self._step_m + 1e-4
        half = np.arcsin(np.minimum(reach / np.maximum(distance, 1e-9), 1.0)) + 2 * self._step_rad + 1e-4
        # Within the window the sensor moves on, which widens the window: close by, when driving fast.
        drift = self._poses_a_rad * (self._step_m / np.maximum(distance, 1e-9) + self._step_rad)
        half /= np.maximum(1 - drift, 0.1)
        near = (distance >= nearest - reach) & (distance <= furthest + reach) & (half < _WRAP_RAD)
        kept = np.flatnonzero(near)
        half, elevation, fired = half[near], elevation[near], fired[near]
        azimuth = np.arctan2(fired[:, 0], fired[:, 1])
        # A window of angle h reaches asin(sin h / cos e) to the sides at elevation e.
        cosine = np.cos(np.abs(elevation) + half)
        side = np.arcsin(np.minimum(np.sin(half) / np.maximum(cosine, 1e-3), 1.0))
        places_, rays = [], []
        for k, (low, high) in enumerate(zip(self._ring_low, self._ring_high, strict=True)):
            row = np.flatnonzero((elevation + half >= low) & (elevation - half <= high))
            first = np.searchsorted(self._sorted, k * _RING_STRIDE + azimuth[row] - side[row], "left")
            last = np.searchsorted(self._sorted, k * _RING_STRIDE + azimuth[row] + side[row], "right")
            counts = last - first
            places_.append(np.repeat(kept[row], counts))
            rays.append(self._ray[_ranges(first, counts)])
        return np.concatenate(places_), np.concatenate(rays)

    def _seen_by_sensor(self, places: Floats) -> Floats:
        """Places (P, 3) in the frame of the moving sensor at the time at which it looked at them."""
        middle = len(self._rotations) // 2
        fired = (places - self._translations[middle]) @ self._rotations[middle]
        pose = np.full(len(places), middle)
        open_ = np.arange(len(places))
        for _ in range(_ROUNDS):
            azimuth = np.arctan2(fired[open_, 0], fired[open_, 1])
            seen = self._pose_at[_azimuth_bin(azimuth)]
            moved = np.abs(seen - pose[open_]) > 1
            open_, seen = open_[moved], seen[moved]
            if not len(open_):
                break
            pose[open_] = seen
            fired[open_] = np.einsum(
                "nji,nj->ni", self._rotations[seen], places[open_] - self._translations[seen]
            )
        return fired


def _azimuth_bin(azimuth: Floats) -> Index:
    return ((azimuth + np.pi) / (2 * np.pi) * _AZIMUTH_BINS).astype(np.int64) % _AZIMUTH_BINS


def _ranges(first: Index, counts: Index) -> Index:
    """The integers first[i] .. first[i] + counts[i] - 1 of all i, one after another."""
    ends = np.cumsum(counts)
    return np.arange(ends[-1] if len(ends) else 0) + np.repeat(first - (ends - counts), counts)
