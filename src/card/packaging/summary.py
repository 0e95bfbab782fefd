"""The few lines that end a run: what was released, how good it is, where to look."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table, sha256_file

UNITS = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


def summarize(release: Path) -> str:
    """Text on all trees under the folder `release`.

    A tree without the validation report of just its checksums is called so.
    """
    trees = sorted(path.parent for path in release.glob("*/release.json"))
    if not trees:
        return f"nothing released yet under {release}"
    documents = [read_json(tree / "release.json", "release") for tree in trees]
    lines = [
        f"{document['repository']} ({document['spdx']}): {len(document['sequences'])} sequences, "
        f"{sum(document['frames'].values())} frames, {document['files']} files, {_bytes(document['bytes'])}, "
        + ("valid" if _is_validated(tree) else "NOT VALIDATED")
        for tree, document in zip(trees, documents, strict=True)
    ]
    verdicts: Counter[str] = Counter()
    for tree in trees:
        verdicts += Counter(gate["verdict"] for gate in _gates(tree))
    lines.append(
        f"gates: {verdicts['pass']} passed, {verdicts['fail']} failed, {verdicts['overridden']} overridden"
    )
    lines += _overridden([item for document in documents for item in document["overrides"]])
    if waiting := _without_split(trees):
        lines.append(
            f"no split yet: {', '.join(waiting)}; run `snakemake assign_splits`, commit the ledger, release"
        )
    lines.append("look at: " + ", ".join(str(tree / "README.md") for tree in trees))
    return "\n".join(lines)


def _overridden(overrides: Sequence[Mapping[str, str]]) -> list[str]:
    """One line for each override, however many sequences it is signed for."""
    sequences: dict[str, list[str]] = {}
    for item in overrides:
        what = f"{item['stage']} {item['figure']}: {item['reason']} (signed by {item['signed_by']})"
        sequences.setdefault(what, []).append(item["sequence"])
    return [f"  overridden {what}: {', '.join(sorted(names))}" for what, names in sorted(sequences.items())]


def _is_validated(tree: Path) -> bool:
    report, sums = tree.with_name(f"{tree.name}.validation.json"), tree / "SHA256SUMS"
    if not (report.is_file() and sums.is_file()):
        return False
    stated: str | None = read_json(report, "report")["inputs"].get("checksums")
    return stated == sha256_file(sums)


def _gates(tree: Path) -> list[Any]:
    return [
        gate
        for path in sorted(tree.glob("sequences/*/quality.json"))
        for stage in read_json(path, "quality")["stages"].values()
        for gate in stage["gates"]
    ]


def _without_split(trees: Sequence[Path]) -> list[str]:
    """Sequences without a frame in any group; a gap between two blocks of a sequence has none either."""
    grouped: dict[str, bool] = {}
    for tree in trees:
        for path in sorted((tree / "metadata").glob("frames-*.parquet")):
            for row in read_table(path, "release_frames").to_pylist():
                known = row["group"] is not None or row["split"] == "zero_shot"
                grouped[row["sequence"]] = grouped.get(row["sequence"], False) or known
    return sorted(sequence for sequence, known in grouped.items() if not known)


def _bytes(count: int) -> str:
    return next((f"{count / size:.2f} {unit}" for size, unit in UNITS if count >= size), f"{count} bytes")
