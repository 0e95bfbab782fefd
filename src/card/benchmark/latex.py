"""A comparison as LaTeX tables of the paper's form: F and B side by side, best bold, second underlined."""

from collections.abc import Mapping, Sequence
from typing import Any

from card.benchmark.columns import Column, columns
from card.benchmark.tables import PROFILES

SPECIAL = {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
TITLES = {
    "depth": "Depth (without median scaling). Raw predictions.",
    "depth_scaled": "Depth (with per-image median scaling).",
    "height": "Height (without median scaling). Raw predictions.",
    "height_scaled": "Height (with per-image median scaling).",
    "completion": "Depth completion.",
    "completion_without_input": "Depth completion, without pixels whose truth is the input sweep itself.",
}


def latex(document: Mapping[str, Any], evaluations: Sequence[Mapping[str, Any]]) -> str:
    """One ``table*`` a table; needs the packages booktabs and multirow."""
    by_method = {evaluation["method"]: evaluation for evaluation in evaluations}
    head = [
        "% \\usepackage{booktabs,multirow}",
        "\\providecommand{\\best}[1]{\\textbf{#1}}",
        "\\providecommand{\\secbest}[1]{\\underline{#1}}",
    ]
    return "\n".join([*head, *(_table(table, document, by_method) for table in document["tables"])]) + "\n"


def _table(table: Mapping[str, Any], document: Mapping[str, Any], evaluations: Mapping[str, Any]) -> str:
    rows = table["methods"]
    settings = evaluations[rows[0]["method"]]["settings"]
    names = list(dict.fromkeys(key.split("/")[0] for key in table["columns"]))
    shown = columns(names, settings)
    over = _over(document, [evaluations[row["method"]] for row in rows])
    spans = range(2, 2 * len(names) + 1, 2)
    lines = [
        r"\begin{table*}[t]",
        r"\centering",
        r"\scriptsize",
        r"\setlength{\tabcolsep}{3pt}",
        rf"\begin{{tabular}}{{@{{}} l *{{{2 * len(names)}}}{{c}} @{{}}}}",
        r"\toprule",
        r"\multirow{2}{*}{Method} & "
        + " & ".join(rf"\multicolumn{{2}}{{c}}{{{column.latex_head}}}" for column in shown.values())
        + r" \\",
        "".join(rf"\cmidrule(lr){{{start}-{start + 1}}}" for start in spans),
        " & " + " & ".join(["F & B"] * len(names)) + r" \\",
        r"\midrule",
    ]
    ranked = [_marked(column, shown[key.split("/")[0]]) for key, column in _columns_of(table)]
    for index, row in enumerate(rows):
        cells = " & ".join(column[index] for column in ranked)
        lines.append(rf"{escape(row['method'])} & {cells} \\")
    lines += [
        r"\bottomrule",
        r"\end{tabular}",
        rf"\caption{{{TITLES[table['name']]} {over}}}",
        rf"\label{{tab:{table['name']}}}",
        r"\end{table*}",
        "",
    ]
    return "\n".join(lines)


def _columns_of(table: Mapping[str, Any]) -> list[tuple[str, list[float | None]]]:
    return [(key, [row["values"][k] for row in table["methods"]]) for k, key in enumerate(table["columns"])]


def _marked(values: Sequence[float | None], column: Column) -> list[str]:
    """Cells of a column; equal in print is equally good."""
    printed = [None if value is None else f"{value:.{column.digits}f}" for value in values]
    ranks = sorted({float(text) for text in printed if text is not None}, reverse=column.higher)
    marks = dict(zip(ranks[:2] if len(ranks) > 1 else [], (r"\best", r"\secbest"), strict=False))
    cells = []
    for text in printed:
        mark = None if text is None else marks.get(float(text))
        cells.append("--" if text is None else f"{mark}{{{text}}}" if mark else text)
    return cells


def _over(document: Mapping[str, Any], evaluations: Sequence[Mapping[str, Any]]) -> str:
    """What the numbers are over, as the caption says it."""
    counts, settings = evaluations[0]["counts"], evaluations[0]["settings"]
    valid = [
        f"{escape(evaluation['method'])} {100 * share:.2f}\\,\\%"
        for evaluation in evaluations
        if (share := evaluation["rows"][0]["valid_share"]) is not None
    ]
    return (
        rf"\emph{{Full}} (F) and \emph{{Boxes}} (B) on {escape(document['repository'])} "
        f"{document['version']}, {escape(document['split'])}; "
        f"profile {settings['profile']} ({PROFILES[settings['profile']]}); "
        f"{settings['min_depth_m']:g}--{settings['max_depth_m']:g}\\,m; {counts['frames']} frames, "
        f"{counts['boxes']} boxes, {counts['empty_boxes']} of them empty. "
        f"Valid predictions: {', '.join(valid) or '--'}."
    )


def escape(text: str) -> str:
    """Text as LaTeX prints it."""
    return "".join(SPECIAL.get(c, f"\\{c}" if c in "&%$#_{}" else c) for c in text)
