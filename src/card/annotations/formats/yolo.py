"""Strict reader of YOLO detection labels: ``class x_center y_center width height`` a line."""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from card.annotations.boxes import Box, Rules, checked_box, near_duplicates
from card.annotations.formats.class_map import check_class_map
from card.annotations.formats.collector import Collector, plain
from card.annotations.formats.expected import LEFT, RIGHT, Expected
from card.annotations.formats.text import read_lines
from card.annotations.issues import Issue

FIELDS = 5
FOLDER, CLASSES = "labels", "classes.txt"
PIXEL_UNITS = 2
"""A centre or size from here on is no share of an image but a number of pixels."""
# Python's own float() also takes underscores, other scripts' digits and hexadecimal.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_CLASS = re.compile(r"([0-9]+)(\.0*)?")


def read(annotations: Path, found: Collector) -> None:
    """``labels/<stem>.txt`` and the class maps; an empty file is a frame reviewed without boxes."""
    folder = annotations / FOLDER
    paths = sorted(folder.iterdir()) if folder.is_dir() else []
    strays = [path for path in sorted(annotations.glob("*.txt")) if path.name != CLASSES]
    labelled = False
    for path in [*paths, *strays]:
        file = path.relative_to(annotations).as_posix()
        if path.name == CLASSES:
            continue
        if path.name == RIGHT:
            found.issue(file, 0, "other_camera", f"wanted labels of {LEFT}")
        elif path in strays or path.suffix != ".txt" or not path.is_file():
            found.issue(file, 0, "foreign_file", f"wanted {FOLDER}/<t_ns>.txt")
        elif (frame := found.image(path.stem, file, 0)) is not None:
            labelled = True
            boxes, issues = read_label_file(path, file, found.expected.classes, found.expected.rules)
            found.boxes[frame] = boxes
            found.issues += issues
    if labelled:
        found.issues += check_class_map(annotations, found.expected.classes)


def write(folder: Path, labels: Mapping[str, list[Box]], expected: Expected) -> None:
    """Write ``classes.txt`` and ``labels/<stem>.txt`` for each image."""
    (folder / FOLDER).mkdir(exist_ok=True)
    (folder / CLASSES).write_text("".join(f"{name}\n" for name in expected.classes), encoding="utf-8")
    for image, boxes in labels.items():
        text = lines(boxes, expected.classes)
        (folder / FOLDER / f"{Path(image).stem}.txt").write_text(text, encoding="utf-8")


def lines(boxes: Sequence[Box], classes: Sequence[str]) -> str:
    """Text of one label file."""
    return "".join(_line(box, classes) for box in boxes)


def _line(box: Box, classes: Sequence[str]) -> str:
    values = (box.x_center, box.y_center, box.width, box.height)
    return " ".join([str(list(classes).index(box.name)), *map(plain, values)]) + "\n"


def read_label_file(
    path: Path, file: str, classes: Sequence[str], rules: Rules
) -> tuple[list[Box], list[Issue]]:
    """Boxes of one label file in their order, and everything that was odd about it.

    ``file`` is the name that the issues carry; ``classes`` gives the class of each id. A line with an error
    gives no box.
    """
    issues: list[Issue] = []
    boxes = []
    for number, line in enumerate(read_lines(path, file, issues), 1):
        fields = line.split()
        if line != " ".join(fields) or not fields:
            issues.append(Issue(file, number, "stray_blanks", "blanks besides one between two fields"))
        if fields:
            box = _box(fields, classes, file, number, issues)
            box = checked_box(box, rules, file, issues) if box else None
            if box:
                boxes.append(box)
    issues += near_duplicates(boxes, rules, file)
    return boxes, issues


def _box(fields: list[str], classes: Sequence[str], file: str, line: int, issues: list[Issue]) -> Box | None:
    if len(fields) != FIELDS:
        issues.append(Issue(file, line, "field_count", f"found {len(fields)} fields, wanted {FIELDS}"))
        return None
    name = _class_name(fields[0], classes, file, line, issues)
    values = [_number(field, file, line, issues) for field in fields[1:]]
    numbers = [value for value in values if value is not None]
    if name is None or len(numbers) != len(values):
        return None
    if all(map(math.isfinite, numbers)) and max(map(abs, numbers)) >= PIXEL_UNITS:
        shown = " ".join(fields[1:])
        issues.append(Issue(file, line, "pixel_units", f"found {shown}, wanted shares of the image"))
        return None
    x_center, y_center, width, height = numbers
    return Box(name, x_center, y_center, width, height, line)


def _class_name(field: str, classes: Sequence[str], file: str, line: int, issues: list[Issue]) -> str | None:
    match = _CLASS.fullmatch(field)
    if not match or int(match[1]) >= len(classes):
        wanted = ", ".join(f"{number} {name}" for number, name in enumerate(classes))
        issues.append(Issue(file, line, "unknown_class", f"found {field}, wanted one of {wanted}"))
        return None
    if match[2]:
        issues.append(Issue(file, line, "float_class", f"found {field}, wanted {int(match[1])}"))
    return classes[int(match[1])]


def _number(field: str, file: str, line: int, issues: list[Issue]) -> float | None:
    match = _NUMBER.fullmatch(field)
    if not match:
        code = "not_finite" if _NOT_FINITE.fullmatch(field) else "not_a_number"
        issues.append(Issue(file, line, code, f"found {field}"))
        return None
    if match[2]:
        issues.append(Issue(file, line, "scientific_notation", f"found {field}"))
    return float(field)
