"""What can be wrong with a label file, and how wrong it is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

SEVERITIES = {
    # repaired and logged: one meaning only, badly written
    "bom": "repair",
    "crlf": "repair",
    "stray_blanks": "repair",
    "float_class": "repair",
    "scientific_notation": "repair",
    "small_overrun": "repair",
    # kept and listed for a person
    "near_duplicate": "warn",
    "subpixel_box": "warn",
    "unmarked_image": "warn",
    # not importable
    "not_text": "error",
    "field_count": "error",
    "not_a_number": "error",
    "not_finite": "error",
    "unknown_class": "error",
    "pixel_units": "error",
    "no_extent": "error",
    "overrun": "error",
    "orphan_label": "error",
    "foreign_file": "error",
    "class_map": "error",
    "other_camera": "error",
    "wrong_size": "error",
    "repeated_image": "error",
    "name_mismatch": "error",
    "syntax": "error",
    "unsupported": "error",
    "mixed_formats": "error",
    "missing_field": "error",
    "wrong_type": "error",
    "not_a_box": "error",
    "repeated_key": "error",
    "repeated_id": "error",
    "dangling_id": "error",
}


@dataclass(frozen=True, order=True)
class Issue:
    """One finding: ``file`` relative to the annotations folder, ``line`` from 1, or 0 for the whole file."""

    file: str
    line: int
    code: str
    message: str

    @property
    def severity(self) -> str:
        """``repair``, ``warn`` or ``error``."""
        return SEVERITIES[self.code]


def issue_columns(issues: Sequence[Issue]) -> dict[str, list[Any]]:
    """Columns of table ``annotation_issues``."""
    names = ("file", "line", "code", "severity", "message")
    return {name: [getattr(issue, name) for issue in issues] for name in names}
