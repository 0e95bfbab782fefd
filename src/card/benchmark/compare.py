"""Stage `benchmark`: several methods side by side, as Markdown, LaTeX in the paper's form and JSON."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import atomic_file, read_json, read_table, write_json, write_report
from card.benchmark.columns import columns
from card.benchmark.latex import latex
from card.benchmark.lints import lint_tables
from card.benchmark.pixel_metrics import COMPLETION_METRICS, DEPTH_METRICS, HEIGHT_METRICS
from card.benchmark.tables import cell, grid, statement
from card.errors import CardError

REGIONS = ("full", "boxes")
#: The paper's tables: title, task, scaling, input pixels, metrics.
TABLES = {
    "depth": ("Depth, as predicted", "depth", "none", "all", DEPTH_METRICS),
    "depth_scaled": ("Depth, scaled to the truth's median", "depth", "median", "all", DEPTH_METRICS),
    "height": ("Height, as predicted", "depth", "none", "all", HEIGHT_METRICS),
    "height_scaled": ("Height, scaled to the truth's median", "depth", "median", "all", HEIGHT_METRICS),
    "completion": ("Completion", "completion", "none", "all", COMPLETION_METRICS),
    "completion_without_input": (
        "Completion, without the pixels whose truth is the input itself", "completion", "none", "without",
        COMPLETION_METRICS,
    ),
}  # fmt: skip
#: What all evaluations in one comparison must share.
SHARED = ("repository", "version", "split", "settings")


def compare(
    *, evaluations: Sequence[Path], out: Path, table: Path, tex: Path, report: Path
) -> dict[str, Any]:
    """Write the tables of several evaluations of the same split; return the document `comparison`.

    evaluations : folders that `evaluate` made. out : document `comparison`; table : Markdown; tex : LaTeX.

    CardError where the evaluations are not of the same release, split and settings.
    """
    documents = [read_json(folder / "evaluation.json", "evaluation") for folder in evaluations]
    first = documents[0]
    for document in documents[1:]:
        for name in SHARED:
            if document[name] != first[name]:
                raise CardError(
                    f"evaluations with another {name}", where=document["method"], found=document[name],
                    wanted=f"{first[name]}, as {first['method']}",
                )  # fmt: skip
    tables = {name: made for name in TABLES if (made := _table(name, documents))}
    found = {
        name: {
            row["method"]: dict(zip(made["columns"], row["values"], strict=True)) for row in made["methods"]
        }
        for name, made in tables.items()
    }
    findings = lint_tables(found, _nearest(evaluations))
    document = {
        "schema": "comparison",
        **{name: first[name] for name in ("repository", "version", "split")},
        "profile": first["settings"]["profile"],
        "tables": list(tables.values()),
        "findings": findings,
    }
    write_json(out, document, "comparison")
    with atomic_file(table) as partial:
        partial.write_text(_markdown(document, documents), encoding="utf-8")
    with atomic_file(tex) as partial:
        partial.write_text(latex(document, documents), encoding="utf-8")
    write_report(
        report,
        stage="benchmark",
        settings=first["settings"],
        inputs={
            doc["method"]: path / "evaluation.json" for doc, path in zip(documents, evaluations, strict=True)
        },
        counts={"methods": len(documents), "tables": len(tables), "findings": len(findings)},
        notes=findings,
    )
    return document


def title_of(name: str) -> str:
    """Title of one of the `TABLES`."""
    return TABLES[name][0]


def _table(name: str, documents: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """One table, each metric with a column for full images and one for boxes; None if it has no rows."""
    _, task, scaling, input_pixels, metrics = TABLES[name]
    rows = []
    for document in documents:
        if document["task"] == task:
            by_region = {
                row["region"]: row["metrics"]
                for row in document["rows"]
                if (row["by"], row["scaling"], row["input_pixels"]) == ("all", scaling, input_pixels)
            }
            values = [by_region[region][metric] for metric in metrics for region in REGIONS]
            rows.append({"method": document["method"], "values": values})
    heads = [f"{metric}/{region}" for metric in metrics for region in REGIONS]
    return {"name": name, "columns": heads, "methods": rows} if rows else None


def _nearest(evaluations: Sequence[Path]) -> float:
    """Where the nearest range of distance begins that has any pixel: no pixel is nearer, metres."""
    starts = []
    for folder in evaluations:
        distances = read_table(folder / "distances.parquet", "evaluation_distances").to_pydict()
        pixels = zip(distances["from_m"], distances["truth_pixels"], strict=True)
        starts += [start for start, count in pixels if count]
    return min(starts, default=0.0)


def _markdown(document: Mapping[str, Any], evaluations: Sequence[Mapping[str, Any]]) -> str:
    parts = [f"# {document['repository']} {document['version']}, {document['split']}"]
    parts += [f"- **{evaluation['method']}**: {statement(evaluation)}" for evaluation in evaluations]
    for table in document["tables"]:
        shown = columns([key.split("/")[0] for key in table["columns"]], evaluations[0]["settings"])
        heads = [shown[key.split("/")[0]] for key in table["columns"]]
        marks = [key.split("/")[1][0].upper() for key in table["columns"]]
        lines = [["method", *(f"{head.head} {mark}" for head, mark in zip(heads, marks, strict=True))]]
        for row in table["methods"]:
            cells = [cell(value, head.digits) for value, head in zip(row["values"], heads, strict=True)]
            lines.append([row["method"], *cells])
        parts += [f"## {title_of(table['name'])}", grid(lines, left=1)]
    parts.append("F: full image; B: boxes.")
    parts.append("## Findings")
    parts.append("\n".join(f"- {finding}" for finding in document["findings"]) or "None.")
    return "\n\n".join(parts) + "\n"
