"""An evaluation as Markdown tables that state what they are over."""

from collections.abc import Mapping, Sequence
from typing import Any

from card.benchmark.columns import TASK_METRICS, columns

REGION_NAMES = {"full": "full image", "boxes": "boxes"}
PROFILES = {
    "default": "pixels chosen by the ground truth alone, failures count, images and boxes of equal weight",
    "paper": "only pixels whose prediction lies in the range count, images and boxes of equal weight",
    "pooled": "pixels chosen by the ground truth alone, failures count, all pixels of equal weight",
}


def markdown(document: Mapping[str, Any]) -> str:
    """A document `evaluation` as Markdown; ``-`` where nothing was measured."""
    shown = columns(TASK_METRICS[document["task"]], document["settings"])
    head = ["region", *_case_heads(document), "samples", "valid", *(column.head for column in shown.values())]
    lines = [head]
    for row in document["rows"]:
        if row["by"] == "all":
            lines.append([REGION_NAMES[row["region"]], *_case(document, row), *_numbers(row, shown)])
            if any(row["intervals"][name] for name in shown):
                edges = [_interval(row["intervals"][name], c.digits) for name, c in shown.items()]
                lines.append(["", *("" for _ in _case(document, row)), "", "", *edges])
    parts = [
        f"# {document['method']} on {document['repository']} {document['version']}, {document['split']}",
        statement(document),
        grid(lines, left=1 + len(_case_heads(document))),
    ]
    for by in ("class", "distance", "place", "light"):
        rows = [row for row in document["rows"] if row["by"] == by]
        if rows:
            lines = [[by, head[0], *head[1:]]]
            lines += [
                [row["group"], REGION_NAMES[row["region"]], *_case(document, row), *_numbers(row, shown)]
                for row in rows
            ]
            parts += [f"## By {by}", grid(lines, left=2 + len(_case_heads(document)))]
    return "\n\n".join(parts) + "\n"


def statement(document: Mapping[str, Any]) -> str:
    """What the numbers of an evaluation are over: profile, range, frames, boxes, pixels."""
    counts, settings = document["counts"], document["settings"]
    whole = next(row for row in document["rows"] if (row["region"], row["by"]) == ("full", "all"))
    valid = "-" if whole["valid_share"] is None else f"{100 * whole['valid_share']:.2f} %"
    intervals = (
        f"{100 * settings['confidence']:g} % of {settings['bootstrap_samples']} resamplings by sequence"
    )
    return (
        f"Task {document['task']}, profile `{settings['profile']}` ({PROFILES[settings['profile']]}), "
        f"depth {settings['min_depth_m']:g}-{settings['max_depth_m']:g} m, {document['space']} image. "
        f"{counts['frames']} frames of {counts['sequences']} sequences "
        f"({counts['frames_without_truth']} more have no ground truth, {counts['frames_below_coverage']} "
        f"too few sweeps behind it; {counts['frames_without_road']} have no road plane), "
        f"{counts['pixels']} pixels "
        f"({counts['pixels_out_of_view']} out of the predicted image's view), {counts['boxes']} boxes "
        f"({counts['empty_boxes']} empty, in no mean). Valid predictions: {valid}. Intervals: {intervals}."
    )


def grid(lines: Sequence[Sequence[str]], left: int) -> str:
    """A Markdown table; the first ``left`` columns are text."""
    rule = ["---"] * left + ["---:"] * (len(lines[0]) - left)
    return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], rule, *lines[1:]))


def cell(value: float | None, digits: int) -> str:
    """A value in print; ``-`` for none."""
    return "-" if value is None else f"{value:.{digits}f}"


def _case_heads(document: Mapping[str, Any]) -> list[str]:
    return ["median scaling"] if document["task"] == "depth" else ["the sweep's own pixels"]


def _case(document: Mapping[str, Any], row: Mapping[str, Any]) -> list[str]:
    if document["task"] == "depth":
        return ["yes" if row["scaling"] == "median" else "no"]
    return ["with" if row["input_pixels"] == "all" else "without"]


def _numbers(row: Mapping[str, Any], shown: Mapping[str, Any]) -> list[str]:
    values = [cell(row["metrics"][name], column.digits) for name, column in shown.items()]
    return [str(row["samples"]), cell(row["valid_share"], 4), *values]


def _interval(edges: Sequence[float] | None, digits: int) -> str:
    return "" if edges is None else f"{edges[0]:.{digits}f}-{edges[1]:.{digits}f}"
