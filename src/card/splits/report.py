"""Stage `split_report`: what the splits of one licence's sequences are worth."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import Figure, read_table, write_report, write_table
from card.splits.balance import balance_columns, stratum_deviation
from card.splits.leakage import leakage_columns, percentile_m
from card.splits.tracks import read_anchors, read_track


def report_splits(
    *,
    sequences: Sequence[Mapping[str, Any]],
    anchors: Path,
    leakage: Path,
    balance: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Write the tables `split_leakage` and `split_balance` and their report.

    sequences : {id, place, splits, poses} each; `poses` is None for a sequence without.
    """
    anchored = read_anchors(anchors)
    rows, tracks = [], {}
    for item in sequences:
        table = read_table(Path(item["splits"]), "splits").to_pylist()
        rows += [{"sequence": item["id"], **row} for row in table]
        if item["poses"]:
            tracks[item["id"]] = read_track(Path(item["poses"]), item["id"], anchored)
    leaks = leakage_columns(rows, tracks, {item["id"]: item["place"] for item in sequences})
    write_table(leakage, leaks, "split_leakage")
    shares = balance_columns(rows, settings)
    write_table(balance, shares, "split_balance")
    states = Counter(leaks["state"])
    splits = Counter(row["split"] for row in rows)
    write_report(
        report,
        stage="split_report",
        settings=settings,
        inputs={"anchors": anchors} | {f"splits_{item['id']}": Path(item["splits"]) for item in sequences},
        counts={f"test_{state}": states[state] for state in ("measured", "apart", "unknown")}
        | dict(sorted(splits.items())),
        figures=[
            Figure(
                "leak_m_p5",
                percentile_m(leaks, 5),
                "m",
                "Distance of a test frame to the nearest training frame, 5th percentile; null for none near",
            ),
            Figure(
                "stratum_deviation",
                stratum_deviation(shares),
                "1",
                "Mean difference between share and target over strata and splits",
            ),
        ],
        gates=gates,
    )


def write_lists(splits: Mapping[str, Mapping[str, Path]], out: Mapping[str, Path]) -> None:
    """Write `out` (split -> text file): lines `repository sequence frame`, from repository -> id -> table."""
    from card.artifacts import atomic_file

    lines: dict[str, list[str]] = {split: [] for split in out}
    for repository, tables in sorted(splits.items()):
        for sequence, path in sorted(tables.items()):
            for row in read_table(Path(path), "splits").to_pylist():
                if row["split"] in lines:
                    lines[row["split"]].append(f"{repository} {sequence} {row['frame']}\n")
    for split, path in out.items():
        with atomic_file(path) as partial:
            partial.write_text("".join(lines[split]), encoding="utf-8")
