"""How near the shares of the splits are to their targets, overall and in each stratum."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from card.splits.ledger import ASSIGNED

ALL = "all"


def balance_columns(rows: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> dict[str, list[Any]]:
    """Columns of `split_balance` from {split, stratum} of all frames; stratum `all` is the whole set."""
    counts: dict[str, Counter[str]] = {ALL: Counter()}
    for row in rows:
        if row["split"] in ASSIGNED:
            for stratum in (ALL, row["stratum"]):
                counts.setdefault(stratum, Counter())[row["split"]] += 1
    cells = [
        {
            "stratum": stratum,
            "split": split,
            "frames": count[split],
            "share": count[split] / max(1, count.total()),
            "target": settings[f"{split}_share"],
        }
        for stratum, count in sorted(counts.items())
        for split in ASSIGNED
    ]
    return {
        name: [cell[name] for cell in cells] for name in ("stratum", "split", "frames", "share", "target")
    }


def stratum_deviation(columns: Mapping[str, Sequence[Any]]) -> float | None:
    """Mean of |share - target| over all strata and splits; None without frames."""
    off = [
        abs(share - target)
        for stratum, share, target in zip(
            columns["stratum"], columns["share"], columns["target"], strict=True
        )
        if stratum != ALL
    ]
    return sum(off) / len(off) if off else None
