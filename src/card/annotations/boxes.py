"""A labelled box and the rules it must keep, whatever format it came in."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from card.annotations.issues import Issue

ROUNDING = 1e-9
"""Share of a length by which changing units and adding centre and half the size are off by themselves."""


@dataclass(frozen=True)
class Box:
    """A labelled irregularity: class name, centre and size as shares of the image's width and height.

    ``line`` is where it stands in its file. The left and upper edges of the image are 0, the others 1.
    """

    name: str
    x_center: float
    y_center: float
    width: float
    height: float
    line: int

    def edges(self) -> tuple[float, float, float, float]:
        """x_min, y_min, x_max, y_max as shares of the image."""
        return (
            self.x_center - self.width / 2,
            self.y_center - self.height / 2,
            self.x_center + self.width / 2,
            self.y_center + self.height / 2,
        )


@dataclass(frozen=True)
class Rules:
    """Limits of the checks; see ``settings/annotations``. ``size`` is (width, height) of the image in px."""

    size: tuple[int, int]
    overrun_px: float
    overrun_share: float
    duplicate_iou: float
    subpixel_px: float


def checked_box(box: Box, rules: Rules, file: str, issues: list[Issue]) -> Box | None:
    """``box``, cut at the border where it runs over by little; None, with an error, for one beyond repair."""
    values = (box.x_center, box.y_center, box.width, box.height)
    shown = " ".join(f"{value:g}" for value in values)
    if not all(map(math.isfinite, values)):
        issues.append(Issue(file, box.line, "not_finite", f"found {shown}"))
        return None
    if box.width <= 0 or box.height <= 0:
        issues.append(Issue(file, box.line, "no_extent", f"found size {box.width:g} x {box.height:g}"))
        return None
    box_cut = _cut(box, rules, file, issues)
    shorter = min(box.width * rules.size[0], box.height * rules.size[1])
    if box_cut and shorter < rules.subpixel_px * (1 - ROUNDING):
        size = f"{box.width * rules.size[0]:.3g} x {box.height * rules.size[1]:.3g} px"
        issues.append(Issue(file, box.line, "subpixel_box", f"found {size}"))
    return box_cut


def _cut(box: Box, rules: Rules, file: str, issues: list[Issue]) -> Box | None:
    x_min, y_min, x_max, y_max = box.edges()
    overruns = (max(-x_min, x_max - 1), max(-y_min, y_max - 1))
    if max(overruns) <= ROUNDING:
        return box
    pixels = [max(share, 0.0) * size for share, size in zip(overruns, rules.size, strict=True)]
    found = f"{pixels[0]:.3g} px in x, {pixels[1]:.3g} px in y"
    allowed = [max(rules.overrun_share, rules.overrun_px / size) for size in rules.size]
    if any(share > limit for share, limit in zip(overruns, allowed, strict=True)):
        issues.append(Issue(file, box.line, "overrun", f"found {found}, wanted at most {rules.overrun_px:g}"))
        return None
    issues.append(Issue(file, box.line, "small_overrun", f"cut {found}"))
    x_center, width = _cut_axis(box.x_center, box.width)
    y_center, height = _cut_axis(box.y_center, box.height)
    return Box(box.name, x_center, y_center, width, height, box.line)


def _cut_axis(center: float, size: float) -> tuple[float, float]:
    """Centre and size of the part within 0 and 1; unchanged, to the bit, where nothing runs over."""
    low, high = center - size / 2, center + size / 2
    if low >= 0 and high <= 1:
        return center, size
    low, high = max(low, 0.0), min(high, 1.0)
    return (low + high) / 2, high - low


def near_duplicates(boxes: Sequence[Box], rules: Rules, file: str) -> Iterator[Issue]:
    """A warning for each later box that covers nearly the same area as an earlier one of its class."""
    for index, box in enumerate(boxes):
        for earlier in boxes[:index]:
            overlap = _iou(box.edges(), earlier.edges())
            if box.name == earlier.name and overlap > rules.duplicate_iou:
                found = f"IoU {overlap:.3f} with line {earlier.line}"
                yield Issue(file, box.line, "near_duplicate", found)
                break


def _iou(a: Sequence[float], b: Sequence[float]) -> float:
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    areas = ((box[2] - box[0]) * (box[3] - box[1]) for box in (a, b))
    return width * height / (sum(areas) - width * height)
