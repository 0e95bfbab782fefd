"""What was done to each image, and how well: table ``images`` and the report of the privacy stage."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from card.artifacts import Figure, write_report
from card.privacy.detection import Detection
from card.privacy.jobs import Job
from card.privacy.recall import LabelledObject, recall_figures
from card.privacy.redaction import Area


@dataclass(frozen=True)
class Outcome:
    """One image: its file, size in pixels, boxes and the areas filled for them, hashes out and in."""

    file: str
    width: int
    height: int
    boxes: list[Detection]
    areas: list[Area]
    redacted_pixels: int
    sha256: str
    source_sha256: str


def image_columns(
    jobs: Sequence[Job], outcomes: Sequence[Outcome], detectors: Sequence[str]
) -> dict[str, list[Any]]:
    """Columns of table ``images``."""
    return {
        "camera": [job.camera for job in jobs],
        "t_ns": [job.t_ns for job in jobs],
        "file": [outcome.file for outcome in outcomes],
        "width": [outcome.width for outcome in outcomes],
        "height": [outcome.height for outcome in outcomes],
        "redactions": [len(outcome.areas) for outcome in outcomes],
        "redacted_pixels": [outcome.redacted_pixels for outcome in outcomes],
        "sha256": [outcome.sha256 for outcome in outcomes],
        "source_sha256": [outcome.source_sha256 for outcome in outcomes],
        "detectors": [", ".join(detectors)] * len(jobs),
    }


def write_account(
    report: Path,
    *,
    sequence: str,
    inputs: Mapping[str, Path],
    labels: Sequence[LabelledObject],
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    jobs: Sequence[Job],
    outcomes: Sequence[Outcome],
    notes: Sequence[str],
) -> None:
    """Write the stage's report, with recall where there are ``labels``."""
    areas: dict[tuple[str, int], list[Area]] = defaultdict(list)
    sizes = {}
    for job, outcome in zip(jobs, outcomes, strict=True):
        areas[job.camera, job.t_ns] += outcome.areas
        sizes[job.camera, job.t_ns] = (outcome.width, outcome.height)
    recall = recall_figures(
        labels,
        areas,
        sizes,
        settings=settings["recall"],
        where=inputs.get("privacy_labels"),
    )
    pixels = sum(outcome.width * outcome.height for outcome in outcomes)
    share = 100 * sum(outcome.redacted_pixels for outcome in outcomes) / pixels
    boxes = [box for outcome in outcomes for box in outcome.boxes]
    kinds, sources = [box.kind for box in boxes], [box.source for box in boxes]
    write_report(
        report,
        stage="privacy",
        sequence=sequence,
        settings=settings,
        inputs=inputs,
        counts={
            "images": len(jobs),
            "faces_redacted": kinds.count("face"),
            "plates_redacted": kinds.count("plate"),
            "from_neighbours": sources.count("neighbour"),
            "from_partner": sources.count("partner"),
            "from_review": sources.count("review"),
            "faces_labelled": sum(labelled.kind == "face" for labelled in labels),
            "plates_labelled": sum(labelled.kind == "plate" for labelled in labels),
        },
        figures=[
            *recall,
            Figure("redacted_share_pct", share, "%", "Share of all pixels that were redacted."),
        ],
        gates=gates,
        overrides=[override for override in settings["overrides"] if sequence in override["sequences"]],
        notes=[*notes, *([] if labels else ["No labelled faces or plates: recall is unknown."])],
    )
