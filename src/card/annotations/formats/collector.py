"""Boxes by frame and everything odd about them, as a reader goes through its files."""

import math

from card.annotations.boxes import Box, checked_box, near_duplicates
from card.annotations.formats.expected import LEFT, Expected
from card.annotations.issues import Issue


class Collector:
    """What readers fill.

    boxes : by frame, in the order of their file; a frame that is a key was reviewed, others were not.
    """

    def __init__(self, expected: Expected) -> None:
        self.expected = expected
        self.boxes: dict[int, list[Box]] = {}
        self.issues: list[Issue] = []
        self._seen: dict[int, str] = {}

    def issue(self, file: str, line: int, code: str, message: str) -> None:
        """Note one finding."""
        self.issues.append(Issue(file, line, code, message))

    def image(self, name: str, file: str, line: int) -> int | None:
        """Frame of an image that a file names; None, with an error, for no left image or one named twice."""
        frame = self.expected.frame_of(name)
        if frame is None:
            if self.expected.is_right(name):
                self.issue(file, line, "other_camera", f"found {name}, wanted an image of {LEFT}")
            else:
                self.issue(file, line, "orphan_label", f"no left image has the time of {name}")
        elif frame in self._seen:
            self.issue(file, line, "repeated_image", f"found {name} again, first in {self._seen[frame]}")
            frame = None
        else:
            self._seen[frame] = f"{file}:{line}"
        return frame

    def size(self, width: float | None, height: float | None, file: str, line: int) -> bool:
        """Whether the labels were drawn on an image of the size that the camera has."""
        wanted = self.expected.rules.size
        if (width, height) == wanted:
            return True
        if width is not None and height is not None:
            self.issue(
                file, line, "wrong_size", f"found {width:g} x {height:g}, wanted {wanted[0]} x {wanted[1]}"
            )
        return False

    def class_name(self, name: str, file: str, line: int) -> str | None:
        """The pinned class of that name; blanks around it are repaired."""
        if name not in self.expected.classes and name.strip() in self.expected.classes:
            self.issue(file, line, "stray_blanks", f"blanks around class {name.strip()}")
            return name.strip()
        if name not in self.expected.classes:
            wanted = ", ".join(self.expected.classes)
            self.issue(file, line, "unknown_class", f"found {name or 'nothing'}, wanted one of {wanted}")
            return None
        return name

    def number(self, text: str | None, what: str, file: str, line: int) -> float | None:
        """A number written as text; NaN and infinities are left to the checks of the box."""
        if text is None:
            self.issue(file, line, "missing_field", f"{what} is missing")
            return None
        try:
            # float() also takes underscores and other scripts' digits.
            if not text.isascii() or "_" in text:
                raise ValueError
            return float(text)
        except ValueError:
            self.issue(file, line, "not_a_number", f"found {text.strip() or 'nothing'} as {what}")
            return None

    def reviewed(self, frame: int) -> None:
        """A person has looked at the frame."""
        self.boxes.setdefault(frame, [])

    def listed(self, frame: int, marked: bool, file: str, line: int) -> None:
        """An image was listed without boxes: reviewed only where a mark or the setting says so."""
        if marked or self.expected.listed_is_reviewed:
            self.reviewed(frame)
        else:
            self.issue(file, line, "unmarked_image", "listed without boxes or mark: taken as not reviewed")

    def edges(self, frame: int, name: str, edges: tuple[float, ...], file: str, line: int) -> None:
        """Add a box of x_min, y_min, x_max, y_max in px from the image's outer left and upper edges."""
        width, height = self.expected.rules.size
        x_min, x_max = edges[0] / width, edges[2] / width
        y_min, y_max = edges[1] / height, edges[3] / height
        centre = (x_min + x_max) / 2, (y_min + y_max) / 2
        self.add(frame, Box(name, *centre, x_max - x_min, y_max - y_min, line), file)

    def add(self, frame: int, box: Box, file: str) -> None:
        """Add a box that passes the checks."""
        self.reviewed(frame)
        if checked := checked_box(box, self.expected.rules, file, self.issues):
            self.boxes[frame].append(checked)

    def finish(self, frame: int, file: str) -> None:
        """All boxes of a frame are in: look for near duplicates."""
        self.issues += near_duplicates(self.boxes.get(frame, []), self.expected.rules, file)


def plain(value: float) -> str:
    """A finite number that reads back as the same float64, without an exponent."""
    import numpy as np

    assert math.isfinite(value)
    return str(np.format_float_positional(value, trim="-"))
