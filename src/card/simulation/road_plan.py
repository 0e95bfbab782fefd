"""Where along a drive's road its bumps, potholes, patches and manholes are."""

import numpy as np

from card.simulation.centreline import CentreLine
from card.simulation.drives import Drive
from card.simulation.irregularities import PROFILES, Bump, Irregularity, Manhole, Patch, pothole

_CUSHION_WIDTH_M = 1.7
#: What is built into a road keeps this far apart, along and across.
_APART_M = (0.7, 0.25)


def plan(
    drive: Drive, line: CentreLine, camera_s: float, rng: np.random.Generator
) -> tuple[Irregularity, ...]:
    """What interrupts the road; the cameras' excerpt always starts before one of each kind there is.

    camera_s : arc length where the cameras start.
    """
    edge, lane = drive.section.half_width, drive.section.lane
    found: list[Irregularity] = []
    for s in _spots(camera_s + 8.0, drive.bump_spacing, line, rng):
        found += _bumps(drive, s, rng)
    for s in _spots(camera_s + 12.5, drive.pothole_spacing, line, rng):
        d = lane + rng.choice([-0.84, 0.84]) + rng.uniform(-0.25, 0.25)
        found.append(pothole(s, float(np.clip(d, 0.6 - edge, edge - 0.6)), rng))
    for s in _spots(camera_s + 4.5, drive.manhole_spacing, line, rng):
        found.append(Manhole(s, lane + rng.uniform(-0.9, 0.3), rng.uniform(-0.018, 0.004)))
    for s in _spots(camera_s + 10.0, drive.patch_spacing, line, rng):
        along, across = rng.uniform(0.4, 2.5), rng.uniform(0.4, 1.1)
        d = rng.uniform(across - edge + 0.3, edge - across - 0.3)
        found.append(Patch(s, d, along, across, rng.uniform(-0.008, 0.010)))
    return tuple(_apart(found))


def _bumps(drive: Drive, s: float, rng: np.random.Generator) -> list[Irregularity]:
    """One bump across the road, or a cushion in each lane."""
    edge, lane = drive.section.half_width, drive.section.lane
    across = 0.15 - edge, edge - 0.15
    if not drive.section.paved:
        return [Bump(s, *across, rng.uniform(1.0, 2.0), rng.uniform(0.04, 0.07), "sinusoidal")]
    profile = str(rng.choice(PROFILES))
    if profile == "cushion":
        length, rise, half = rng.uniform(2.0, 3.0), rng.uniform(0.05, 0.07), _CUSHION_WIDTH_M / 2
        return [Bump(s, d - half, d + half, length, rise, profile) for d in (lane, -lane)]
    shortest, longest = (3.6, 4.6) if profile == "flat" else (1.2, 3.0)
    return [Bump(s, *across, rng.uniform(shortest, longest), rng.uniform(0.05, 0.09), profile)]


def _spots(start: float, spacing: float, line: CentreLine, rng: np.random.Generator) -> list[float]:
    if not spacing:
        return []
    first, last = line.start + 4, line.start + line.length - 4
    steps = np.arange(np.ceil((first - start) / spacing), np.floor((last - start) / spacing) + 1)
    jitter = np.where(steps == 0, 0.0, rng.uniform(-0.25, 0.25, len(steps)))
    spots = start + (steps + jitter) * spacing
    return [float(s) for s in spots if first < s < last]


def _apart(things: list[Irregularity]) -> list[Irregularity]:
    """Without those that would run into an earlier one."""
    kept: list[Irregularity] = []
    for thing in things:
        s_min, s_max, d_min, d_max = thing.extent
        along, across = _APART_M
        if all(
            s_min - along > k.extent[1]
            or s_max + along < k.extent[0]
            or d_min - across > k.extent[3]
            or d_max + across < k.extent[2]
            for k in kept
        ):
            kept.append(thing)
    return kept
