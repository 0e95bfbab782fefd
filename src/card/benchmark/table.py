"""An evaluation as a Markdown table that states what it is over."""

from collections.abc import Mapping
from typing import Any

from card.benchmark.height_metrics import threshold_name

REGION_NAMES = {"full": "full image", "boxes": "boxes"}


def markdown(document: Mapping[str, Any]) -> str:
    """A document `evaluation` as Markdown; ``-`` where nothing was measured."""
    counts, settings = document["counts"], document["settings"]
    columns = {
        "AbsRel ↓": "abs_rel",
        "SqRel [m] ↓": "sq_rel",
        "RMSE [m] ↓": "rmse",
        "RMSElog ↓": "rmse_log",
        **{f"δ{n} ↑": f"delta_{n}" for n in (1, 2, 3)},
        "valid ↑": "valid_share",
        "height AbsDiff [m] ↓": "height_abs_diff",
        "height RMSE [m] ↓": "height_rmse",
        **{f"δ@{100 * t:g} cm ↑": threshold_name(t) for t in settings["height_thresholds_m"]},
    }
    head = ["region", "median scaling", "samples", *columns]
    lines = [head, ["---", "---", *["---:"] * (len(head) - 2)]]
    for row in document["rows"]:
        scaled = "yes" if row["scaling"] == "median" else "no"
        cells = [_cell(row["metrics"].get(name)) for name in columns.values()]
        lines.append([REGION_NAMES[row["region"]], scaled, str(row["samples"]), *cells])
    return "\n".join(
        [
            f"# {document['method']} on {document['repository']} {document['version']}, {document['split']}",
            "",
            f"Profile `{settings['profile']}`, "
            f"depth {settings['min_depth_m']:g}-{settings['max_depth_m']:g} m. "
            f"{counts['frames']} frames ({counts['frames_without_truth']} more have no ground truth, "
            f"{counts['frames_without_road']} have no road plane), {counts['pixels']} pixels, "
            f"{counts['boxes']} boxes ({counts['empty_boxes']} empty, in no mean).",
            "",
            *("| " + " | ".join(line) + " |" for line in lines),
            "",
        ]
    )


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
