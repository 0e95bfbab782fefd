"""Quality of a sequence from the reports of its stages; a failed gate keeps it out of a release."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import read_json
from card.errors import CardError

KEPT = ("counts", "figures", "gates", "notes", "settings", "versions")


def gather_quality(sequence: str, reports: Mapping[str, Path]) -> dict[str, Any]:
    """Document `quality`: what each report in `reports` (stage -> path) states.

    CardError for the first gate that failed without a signed override.
    """
    stages = {}
    for stage, path in sorted(reports.items()):
        report = read_json(path, "report")
        if report["sequence"] not in (sequence, None):
            raise CardError(
                "report of another sequence", where=path, found=report["sequence"], wanted=sequence
            )
        if report["stage"] != stage:
            raise CardError("report of another stage", where=path, found=report["stage"], wanted=stage)
        for gate in report["gates"]:
            if gate["verdict"] == "fail":
                raise _failed(sequence, stage, gate)
        stages[stage] = {name: report[name] for name in KEPT}
    return {"schema": "quality", "sequence": sequence, "stages": stages}


def _failed(sequence: str, stage: str, gate: Mapping[str, Any]) -> CardError:
    side = ">=" if gate["better"] == "higher" else "<="
    value = "no value" if gate["value"] is None else f"{gate['value']:g} {gate['unit']}"
    return CardError(
        f"gate of stage {stage} failed, so the sequence cannot be released; mend it, or set `quarantine` "
        f"with a reason in config/sequences.tsv",
        where=f"sequence {sequence}",
        found=f"{gate['figure']} = {value}",
        wanted=f"{side} {gate['threshold']:g} {gate['unit']}",
    )
