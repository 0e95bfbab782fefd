"""The annotation stage: what the label tool left becomes one table, or a list of what is wrong with it."""

import logging
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image, UnidentifiedImageError

from card.annotations.boxes import Box, Rules
from card.annotations.class_map import check_class_map
from card.annotations.issues import Issue, issue_columns
from card.annotations.yolo import read_label_file
from card.artifacts import Figure, read_table, write_report, write_table
from card.errors import CardError

NOT_REVIEWED, REVIEWED_NONE, BOXES = "not_reviewed", "reviewed_none", "boxes"
logger = logging.getLogger("card")


def import_labels(
    *,
    recording: Path,
    annotations: Path,
    frames: Path,
    labels: Path,
    label_states: Path,
    issues: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Import the YOLO labels of a sequence (paper, Road Topography Annotations and Annotation Pipeline).

    Parameters
    ----------
    recording : folder of the images; one is opened, for its size.
    annotations : folder with ``classes.txt`` and ``labels/<t_ns>.txt``; absent when nobody has labelled yet.
    frames : table ``frames`` of the sequence; a label file belongs to the left image of the same stem.
    labels, label_states, issues : tables ``labels``, ``label_states`` and ``annotation_issues`` to write.

    A frame without a file is ``not_reviewed``, one with an empty file ``reviewed_none``; one with boxes,
    ``boxes``. Raises ``CardError`` for the first issue of severity ``error``, once all are listed in
    ``issues`` and in the log.
    """
    table = read_table(frames, "frames")
    stems = {
        Path(file).stem: frame
        for frame, file in zip(table["frame"].to_pylist(), table["left_file"].to_pylist(), strict=True)
    }
    files, found = _label_files(annotations, stems)
    boxes: dict[int, list[Box]] = {}
    if files:
        found += check_class_map(annotations, settings["classes"])
        rules = _rules(recording / table["left_file"][0].as_py(), settings)
        for frame, path in files.items():
            boxes[frame], more = read_label_file(path, f"labels/{path.name}", settings["classes"], rules)
            found += more
    found.sort()
    write_table(issues, issue_columns(found), "annotation_issues")
    _raise_errors(found, annotations)

    states = {frame: _state(boxes.get(frame)) for frame in sorted(stems.values())}
    rows = [(frame, box) for frame in sorted(boxes) for box in boxes[frame]]
    write_table(labels, _label_columns(rows), "labels")
    write_table(label_states, {"frame": list(states), "state": list(states.values())}, "label_states")
    tally = Counter(states.values())
    severities = Counter(issue.severity for issue in found)
    names = Counter(box.name for _, box in rows)
    write_report(
        report,
        stage="annotations",
        sequence=report.parent.name,
        settings=settings,
        inputs={"frames": frames},
        counts={
            "frames": len(states),
            **{f"frames_{state}": tally[state] for state in (NOT_REVIEWED, REVIEWED_NONE, BOXES)},
            **{f"boxes_{name}": names[name] for name in sorted(settings["classes"])},
            "repairs": severities["repair"],
            "warnings": severities["warn"],
        },
        figures=[
            Figure(
                "reviewed_pct",
                100 * (1 - tally[NOT_REVIEWED] / len(states)) if states else None,
                "%",
                "Share of the frames that a person has looked at.",
            )
        ],
        gates=gates,
    )


def _label_files(annotations: Path, stems: Mapping[str, int]) -> tuple[dict[int, Path], list[Issue]]:
    """The label file of each frame that has one, and an issue for every file that belongs to none."""
    files, issues = {}, []
    folder = annotations / "labels"
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        name = f"labels/{path.name}"
        if path.name == "classes.txt":
            continue
        if path.suffix != ".txt" or not path.is_file():
            issues.append(Issue(name, 0, "foreign_file", "wanted <t_ns>.txt"))
        elif path.stem not in stems:
            issues.append(Issue(name, 0, "orphan_label", "no left image has this time"))
        else:
            files[stems[path.stem]] = path
    return files, issues


def _rules(image: Path, settings: Mapping[str, Any]) -> Rules:
    try:
        with Image.open(image) as header:
            size = header.size
    except (OSError, UnidentifiedImageError) as error:
        raise CardError("image size cannot be read", where=image, found=error) from error
    names = ("overrun_px", "overrun_share", "duplicate_iou", "subpixel_px")
    return Rules(size, **{name: settings[name] for name in names})


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


def _label_columns(rows: Sequence[tuple[int, Box]]) -> dict[str, list[Any]]:
    columns: dict[str, list[Any]] = {
        "frame": [frame for frame, _ in rows],
        "class": [box.name for _, box in rows],
    }
    for name in ("x_center", "y_center", "width", "height"):
        columns[name] = [getattr(box, name) for _, box in rows]
    return columns
