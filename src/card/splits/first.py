"""The first assignment of splits: all groups at once, as a mixed-integer programme."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.splits.groups import Group
from card.splits.ledger import ASSIGNED

TEST = ASSIGNED.index("test")
EMPTY_COST = 0.5
"""Of a split that lacks a stratum although it has groups enough, in shares of frames off the target."""


def first_assignment(groups: Sequence[Group], settings: Mapping[str, Any]) -> list[str] | None:
    """A split for each group, so that the shares of all frames and of each stratum come near their targets.

    Minimises the sum of |share - target| over the splits of the whole set plus its mean over the strata,
    with HiGHS, which stops after `milp_nodes` nodes: a limit on time would not repeat. A group that touches
    a zero-shot drive is kept out of training and validation. None if that many nodes hold no solution.
    """
    from scipy.optimize import Bounds, LinearConstraint, milp

    strata = sorted({name for group in groups for name in group.counts})
    sizes = np.array([[group.counts[name] for name in strata] for group in groups], dtype=float)
    sizes = np.column_stack([sizes.reshape(len(groups), len(strata)), [g.counts.total() for g in groups]])
    targets = shares(settings)
    totals = sizes.sum(axis=0)
    rows = np.flatnonzero(totals)
    relative = sizes[:, rows] / totals[rows]
    rich = [r for r in range(len(rows)) if (relative[:, r] > 0).sum() >= len(ASSIGNED)]
    weights = np.array([1.0 if row == len(strata) else 1.0 / max(1, len(strata)) for row in rows])

    # Variables: chosen (group, split), deviation (row, split), and a lacking (rich row, split).
    splits = len(ASSIGNED)
    chosen, deviation, lacking = len(groups) * splits, len(rows) * splits, len(rich) * splits
    count = chosen + deviation + lacking
    cost = np.concatenate(
        [np.zeros(chosen), np.repeat(weights, splits), EMPTY_COST * np.repeat(weights[rich], splits)]
    )
    once = np.zeros((len(groups), count))
    for index in range(len(groups)):
        once[index, index * splits : (index + 1) * splits] = 1
    off, filled = np.zeros((2 * deviation, count)), np.zeros((lacking, count))
    bounds_off = np.zeros(2 * deviation)
    for row in range(len(rows)):
        for split in range(splits):
            at = row * splits + split
            for side, sign in enumerate((1, -1)):
                off[2 * at + side, split:chosen:splits] = sign * relative[:, row]
                off[2 * at + side, chosen + at] = -1
                bounds_off[2 * at + side] = sign * targets[split]
    for position, row in enumerate(rich):
        for split in range(splits):
            at = position * splits + split
            filled[at, split:chosen:splits] = relative[:, row] > 0
            filled[at, chosen + deviation + at] = 1
    upper = np.ones(count)
    for index, group in enumerate(groups):
        if group.touches_zero_shot:
            upper[[index * splits + split for split in range(splits) if split != TEST]] = 0
    solved = milp(
        cost,
        integrality=np.concatenate([np.ones(chosen), np.zeros(count - chosen)]),
        bounds=Bounds(np.zeros(count), upper),
        constraints=[
            LinearConstraint(once, 1, 1),
            LinearConstraint(off, -np.inf, bounds_off),
            *([LinearConstraint(filled, 1, np.inf)] if lacking else []),
        ],
        options={"node_limit": settings["milp_nodes"]},
    )
    if solved.x is None:
        return None
    best = solved.x[:chosen].reshape(len(groups), splits).argmax(axis=1)
    return [ASSIGNED[index] for index in best]


def deviation(groups: Sequence[Group], splits: Sequence[str], settings: Mapping[str, Any]) -> float:
    """What `first_assignment` minimises, apart from the cost of a split that lacks a stratum."""
    strata = sorted({name for group in groups for name in group.counts})
    found = np.zeros((len(strata) + 1, len(ASSIGNED)))
    for group, split in zip(groups, splits, strict=True):
        for name, size in group.counts.items():
            found[[strata.index(name), -1], ASSIGNED.index(split)] += size
    found = found[found.sum(axis=1) > 0]
    if not found.size:
        return 0.0
    off = np.abs(found / found.sum(axis=1, keepdims=True) - shares(settings)).sum(axis=1)
    return float(off[-1] + off[:-1].sum() / len(strata))


def shares(settings: Mapping[str, Any]) -> NDArray[np.float64]:
    """Target shares of the splits in the order of `ASSIGNED`."""
    return np.array([settings[f"{split}_share"] for split in ASSIGNED], dtype=np.float64)
