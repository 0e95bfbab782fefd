"""The annotation stage: what the label tool left becomes one table, or a list of what is wrong with it."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from card.annotations.boxes import Box, Rules
from card.annotations.formats import FORMATS
from card.annotations.formats.collector import Collector
from card.annotations.formats.expected import Expected
from card.annotations.formats.recognise import recognise
from card.annotations.issues import Issue, issue_columns
from card.artifacts import Figure, read_json, read_table, write_report, write_table
from card.errors import CardError

NOT_REVIEWED, REVIEWED_NONE, BOXES = "not_reviewed", "reviewed_none", "boxes"
SIDES = ("width", "height")
logger = logging.getLogger("card")


def import_labels(
    *,
    annotations: Path,
    frames: Path,
    ingest_report: Path,
    off_road: bool,
    labels: Path,
    label_states: Path,
    issues: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Import the labels of a sequence (paper, Road Topography Annotations and Annotation Pipeline).

    Parameters
    ----------
    annotations : folder as the label tool left it; absent when nobody has labelled yet.
    frames : table ``frames`` of the sequence; labels belong to the left image of the same stem.
    ingest_report : report that counts the pixels of the left image, ``camera_left_width_px`` and
        ``camera_left_height_px``; no image is opened.
    off_road : the sequence's flag in the sheet: the whole road is irregular, and nobody draws boxes.
    labels, label_states, issues : tables ``labels``, ``label_states`` and ``annotation_issues`` to write.

    A frame that no label file speaks of is ``not_reviewed``, one that a person has looked at is ``boxes`` or
    ``reviewed_none``. Raises ``CardError`` for the first issue of severity ``error``, once all are listed in
    ``issues`` and in the log.
    """
    expected = read_expected(frames, ingest_report, settings)
    boxes, form, found = read_annotations(annotations, expected, settings["format"])
    write_table(issues, issue_columns(found), "annotation_issues")
    _raise_errors(found, annotations)

    states = {frame: _state(boxes.get(frame)) for frame in sorted(expected.frames.values())}
    rows = [(frame, box) for frame in sorted(boxes) for box in boxes[frame]]
    write_table(labels, label_columns(rows), "labels")
    write_table(label_states, {"frame": list(states), "state": list(states.values())}, "label_states")
    tally = Counter(states.values())
    severities = Counter(issue.severity for issue in found)
    names = Counter(box.name for _, box in rows)
    notes = [f"labels in format {form}"] if form else ["no labels"]
    if off_road:
        notes.append("off-road: the whole road is irregular, frames need no boxes")
    write_report(
        report,
        stage="annotations",
        sequence=report.parent.name,
        settings=settings,
        inputs={"frames": frames, "ingest_report": ingest_report},
        counts={
            "frames": len(states),
            **{f"frames_{state}": tally[state] for state in (NOT_REVIEWED, REVIEWED_NONE, BOXES)},
            **{f"boxes_{name}": names[name] for name in sorted(settings["classes"])},
            "repairs": severities["repair"],
            "warnings": severities["warn"],
            "off_road": int(off_road),
        },
        figures=[
            Figure(
                "reviewed_pct",
                100 * (1 - tally[NOT_REVIEWED] / len(states)) if states else None,
                "%",
                "Share of the frames that a person has looked at.",
            ),
            *_statistics([box for _, box in rows], tally[BOXES], expected.rules.size),
        ],
        gates=gates,
        notes=notes,
    )


def read_expected(frames: Path, ingest_report: Path, settings: Mapping[str, Any]) -> Expected:
    """What labels of a sequence must fit; see `import_labels` for the arguments."""
    table = read_table(frames, "frames")
    counts = read_json(ingest_report, "report")["counts"]
    try:
        width, height = (counts[f"camera_left_{side}_px"] for side in SIDES)
    except KeyError as error:
        raise CardError("size of the left image is not stated", where=ingest_report, wanted=error) from error
    names = ("overrun_px", "overrun_share", "duplicate_iou", "subpixel_px")
    left = zip(table["left_file"].to_pylist(), table["frame"].to_pylist(), strict=True)
    return Expected(
        frames={Path(file).stem: frame for file, frame in left},
        right=frozenset(Path(file).stem for file in table["right_file"].to_pylist() if file),
        classes=settings["classes"],
        rules=Rules((width, height), **{name: settings[name] for name in names}),
        listed_is_reviewed=settings["listed_is_reviewed"],
    )


def read_annotations(
    annotations: Path, expected: Expected, setting: str
) -> tuple[dict[int, list[Box]], str | None, list[Issue]]:
    """Boxes by reviewed frame, the format they came in (None: no labels), and all issues, sorted."""
    found = Collector(expected)
    form = recognise(annotations, setting, found.issues) if annotations.is_dir() else None
    if form:
        FORMATS[form].read(annotations, found)
    return found.boxes, form, sorted(found.issues)


def label_columns(rows: Sequence[tuple[int, Box]]) -> dict[str, list[Any]]:
    """Columns of table ``labels`` for boxes with their frames."""
    columns: dict[str, list[Any]] = {
        "frame": [frame for frame, _ in rows],
        "class": [box.name for _, box in rows],
    }
    for name in ("x_center", "y_center", "width", "height"):
        columns[name] = [getattr(box, name) for _, box in rows]
    return columns


def _statistics(boxes: Sequence[Box], frames: int, size: tuple[int, int]) -> list[Figure]:
    """Of the boxes in so many frames with any."""
    figures = [
        Figure(
            "boxes_per_frame",
            len(boxes) / frames if frames else None,
            "1",
            "Boxes in a frame that has any, in the mean.",
        )
    ]
    for side, pixels in zip(SIDES, size, strict=True):
        values = [getattr(box, side) * pixels for box in boxes]
        figures.append(
            Figure(f"box_{side}_px", median(values) if values else None, "px", f"Median {side} of a box.")
        )
    return figures


def _raise_errors(found: Sequence[Issue], annotations: Path) -> None:
    errors = [issue for issue in found if issue.severity == "error"]
    for issue in errors:
        logger.error("%s:%d: %s: %s", annotations / issue.file, issue.line, issue.code, issue.message)
    if errors:
        first = errors[0]
        more = f"; {len(errors) - 1} more errors in the log" if len(errors) > 1 else ""
        where = f"{annotations / first.file}:{first.line}"
        raise CardError(f"{first.code}: {first.message}{more}", where=where)


def _state(boxes: Sequence[Box] | None) -> str:
    if boxes is None:
        return NOT_REVIEWED
    return BOXES if boxes else REVIEWED_NONE
