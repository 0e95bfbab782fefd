"""Quality figures of a sequence's stages with the verdicts of their gates, as HTML."""

from collections import Counter
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from card.report.numbers import number


def verdicts(stages: Mapping[str, Mapping[str, Any]]) -> Counter[str]:
    """How many gates of the stages passed, failed and were overridden."""
    return Counter(gate["verdict"] for stage in stages.values() for gate in stage["gates"])


def badge(counts: Mapping[str, int]) -> str:
    """The worst verdict of a sequence in a word; without gates that is said."""
    for verdict in ("fail", "overridden", "pass"):
        if counts.get(verdict):
            return _mark(verdict, f"{counts[verdict]} {verdict}")
    return '<span class="mark none">no gates</span>'


def quality_table(stages: Mapping[str, Mapping[str, Any]]) -> str:
    """One row a figure, by stage: value, what it says, its gate and the verdict; empty without any."""
    rows = [row for name, stage in stages.items() for row in _stage_rows(name, stage)]
    if not rows:
        return ""
    head = (
        '<th>stage</th><th>figure</th><th class="n">value</th><th>unit</th>'
        '<th class="n">gate</th><th>verdict</th>'
    )
    return (
        f'<h3>Quality</h3><div class="wide"><table class="quality"><thead><tr>{head}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def notes_list(stages: Mapping[str, Mapping[str, Any]]) -> str:
    """Remarks of the stages as a list; empty without any."""
    items = [
        f"<li><b>{stage_name(name)}</b> {escape(note)}</li>"
        for name, stage in stages.items()
        for note in stage["notes"]
    ]
    return f'<ul class="notes">{"".join(items)}</ul>' if items else ""


def stage_name(stage: str) -> str:
    """A stage as HTML text."""
    return escape(stage.replace("_", " "))


def _stage_rows(name: str, stage: Mapping[str, Any]) -> Iterable[str]:
    gates = {gate["figure"]: gate for gate in stage["gates"]}
    figures = list(stage["figures"])
    known = {figure["name"] for figure in figures}
    # A gate on a figure that the stage did not state has failed, and must be seen.
    figures += [
        {"name": gate["figure"], "value": None, "unit": gate["unit"], "description": "not stated"}
        for gate in stage["gates"]
        if gate["figure"] not in known
    ]
    for index, figure in enumerate(figures):
        first, shown = ("first", stage_name(name)) if index == 0 else ("", "")
        yield (
            f'<tr class="{first}"><td class="stage">{shown}</td>'
            f"<td><b>{escape(figure['name'])}</b><small>{escape(figure['description'])}</small></td>"
            f'<td class="n">{number(figure["value"])}</td><td>{_unit(figure["unit"])}</td>'
            f"{_gate_cells(gates.get(figure['name']))}</tr>"
        )


def _gate_cells(gate: Mapping[str, Any] | None) -> str:
    if gate is None:
        return "<td></td><td></td>"
    side = "≥" if gate["better"] == "higher" else "≤"
    signed = ""
    if gate["verdict"] == "overridden":
        signed = f"<small>{escape(gate['reason'])} ({escape(gate['signed_by'])})</small>"
    mark = _mark(gate["verdict"], gate["verdict"])
    return f'<td class="n">{side} {number(gate["threshold"])}</td><td>{mark}{signed}</td>'


def _mark(verdict: str, text: str) -> str:
    return f'<span class="mark {verdict}">{text}</span>'


def _unit(unit: str) -> str:
    return "" if unit == "1" else escape(unit)
