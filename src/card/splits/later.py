"""Later assignments: new groups one by one, while every old row stays where it is."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from card.splits.groups import Group
from card.splits.ledger import ASSIGNED


def later_assignment(
    groups: Sequence[Group],
    settings: Mapping[str, Any],
    known: Mapping[str, Counter[str]] | None = None,
    fixed: Mapping[str, str] | None = None,
) -> list[str]:
    """A split for each group, largest first.

    Each goes to the split with the largest deficit against its target share, in sampled frames, summed over
    the whole set and the group's strata; of equal deficits the smaller split wins.

    Parameters
    ----------
    known : sampled frames by split and stratum of what is assigned already.
    fixed : splits of groups by name that are not free to choose.
    """
    counts = {split: Counter((known or {}).get(split, {})) for split in ASSIGNED}
    found: dict[str, str] = {}
    for group in sorted(groups, key=lambda group: (-group.counts.total(), group.name)):
        split = (fixed or {}).get(group.name) or _neediest(group, counts, settings)
        counts[split] += group.counts
        found[group.name] = split
    return [found[group.name] for group in groups]


def _neediest(group: Group, counts: Mapping[str, Counter[str]], settings: Mapping[str, Any]) -> str:
    size = group.counts.total()
    total = {split: count.total() for split, count in counts.items()}
    everything = sum(total.values()) + size

    def deficit(split: str) -> float:
        share = settings[f"{split}_share"]
        inside = sum(
            share * (sum(count[name] for count in counts.values()) + added) - counts[split][name]
            for name, added in group.counts.items()
        )
        return float(share * everything - total[split] + inside)

    return min(ASSIGNED, key=lambda split: (-round(deficit(split), 6), total[split]))
