"""Strict reader of YOLO detection labels: ``class x_center y_center width height`` a line."""

import re
from collections.abc import Sequence
from pathlib import Path

from card.annotations.boxes import Box, Rules, checked_box, near_duplicates
from card.annotations.issues import Issue
from card.annotations.text import read_lines

FIELDS = 5
# Python's own float() also takes underscores, other scripts' digits and hexadecimal.
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", re.IGNORECASE)
_CLASS = re.compile(r"([0-9]+)(\.0*)?")


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
