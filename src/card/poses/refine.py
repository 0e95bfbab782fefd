"""Stage 2: the batch, with loops searched twice and a robust pass at the end."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.estimation.batch import Batch, Between, Nodes, residuals
from card.poses.loops import Loop, candidates, travelled

Array = NDArray[np.float64]
Verify = Callable[[Array, int, int, float], Loop]
#: The robust pass narrows its kernel by this factor a solve, down to a residual of CUT sigmas.
NARROWING, CUT = 4.0, 3.0
#: Median normalised residual of six components of the right size.
TYPICAL = 0.94
#: A loop of a smaller weight counts as an outlier.
OUTLIER = 0.25


@dataclass(frozen=True)
class Refined:
    """The solution. loops, weights (L,): proved loops and how much each counts in the end."""

    nodes: Nodes
    local: list[Between]
    loops: list[Loop]
    weights: Array
    tried: int


def local_constraints(
    nodes: Nodes, information: Array, registered: NDArray[np.bool_], settings: Mapping[str, Any]
) -> list[Between]:
    """Each registered node against one that lies some metres back: what the local map says of the two.

    Errors of neighbours against the same map are no random walk; chaining them would make them one.
    information (N, 6, 6) : of each scan alone, so that the IMU is not counted twice.
    """
    way = travelled(nodes.poses)
    anchors, found = [0], []
    for k in range(1, len(way)):
        back = [a for a in anchors if way[k] - way[a] >= settings["anchor_m"]]
        anchor = back[-1] if back else 0
        if registered[k]:
            relative = np.linalg.inv(nodes.poses[anchor]) @ nodes.poses[k]
            found.append(Between(anchor, k, relative, information[k] / settings["odometry_inflation"] ** 2))
        if registered[k] and way[k] - way[anchors[-1]] >= settings["anchor_m"]:
            anchors.append(k)
    return found


def refine(
    batch: Batch,
    nodes: Nodes,
    local: Sequence[Between],
    verify: Verify,
    settings: Mapping[str, Any],
    known: Sequence[Loop] = (),
) -> Refined:
    """Plain solution with the loops of a coarse search, a fine search from there, and a robust solution.

    Robust kernels alone reject every true loop where the drift is large against what the odometry claims;
    so loops are proved by geometry first, and judged against each other only after they have pulled.

    known : loops that were found otherwise; they pull beside those of the coarse search.
    """
    inflation = settings["loop_inflation"]
    solution = batch.solve(nodes, local)
    tried = {(loop.first, loop.second) for loop in known}
    loops: list[Loop] = []
    for spacing, share, others in (
        (settings["loop_coarse_m"], settings["drift_share"], known),
        (settings["loop_spacing_m"], 0.0, ()),
    ):
        poses, way = solution.poses, travelled(solution.poses)
        pairs = candidates(poses, spacing, settings["loop_radius_m"], settings["loop_min_way_m"], share)
        found = [verify(poses, a, b, share * float(way[b] - way[a])) for a, b in sorted(pairs)]
        found += others
        tried |= set(pairs)
        # What the fine search finds from a better guess takes the place of the coarse.
        loops = [loop for loop in found if loop.accepted]
        if loops:
            solution = batch.solve(solution, [*local, *(loop.between(inflation) for loop in loops)])
    solution, weights = robust(batch, solution, local, [loop.between(inflation) for loop in loops])
    return Refined(solution, list(local), loops, weights, len(tried))


def robust(
    batch: Batch, nodes: Nodes, local: Sequence[Between], loops: Sequence[Between]
) -> tuple[Nodes, Array]:
    """Solve with a Geman-McClure kernel on the loops that narrows from solve to solve.

    nodes : a plain solution with all loops. After H. Yang et al., "Graduated Non-Convexity for Robust Spatial
    Perception", RA-L 2020: at first all loops pull, then those that the others contradict let go. Where the
    odometry drifts more than it claims, it is believed less first: else it would contradict every true loop.
    """
    if not loops:
        return nodes, np.zeros(0)
    width = np.inf
    weights = np.ones(len(loops))
    while width > CUT:
        nodes = batch.solve(nodes, [*relaxed(nodes, local), *_weighted(loops, weights)])
        off = residuals(nodes, loops)
        width = max(min(width / NARROWING, float(off.max())), CUT)
        weights = (1 + (off / width) ** 2) ** -2.0
    return batch.solve(nodes, [*relaxed(nodes, local), *_weighted(loops, weights)]), weights


def relaxed(nodes: Nodes, local: Sequence[Between]) -> list[Between]:
    """The odometry with its standard deviations grown to what a solution shows they are, in the median."""
    if not local:
        return []
    factor = max(1.0, float(np.median(residuals(nodes, local))) / TYPICAL)
    return [replace(between, information=between.information / factor**2) for between in local]


def _weighted(loops: Sequence[Between], weights: Array) -> list[Between]:
    return [
        replace(loop, information=weight * loop.information)
        for loop, weight in zip(loops, weights, strict=True)
    ]
