"""What a reviewer adds to the redactions and what he clears, each with a reason."""

import csv
import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from card.errors import CardError
from card.privacy.detection import Detection, Kind
from card.privacy.tables import Image

COLUMNS = ["camera", "t_ns", "action", "kind", "x_min", "y_min", "x_max", "y_max", "reason"]
# A box is cleared by a reviewer's box that holds this share of it.
_CLEARED_SHARE = 0.9


class Review(NamedTuple):
    """One line: ``add`` or ``clear`` a box (px, pixel centres at integers), and why."""

    line: int
    action: str
    box: Detection
    reason: str


def read_reviews(path: Path) -> dict[Image, list[Review]]:
    """Lines of ``privacy_review.csv`` by image; CardError names the line that does not fit."""
    lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    if not lines or lines[0] != COLUMNS:
        raise CardError("wrong columns", where=path, found=lines[0] if lines else "nothing", wanted=COLUMNS)
    found: dict[Image, list[Review]] = defaultdict(list)
    for number, cells in enumerate(lines[1:], 2):
        where = f"{path}:{number}"
        if len(cells) != len(COLUMNS):
            raise CardError("row does not fit", where=where, found=",".join(cells), wanted=COLUMNS)
        camera, t_ns, action, kind, *edges, reason = cells
        if action not in ("add", "clear"):
            raise CardError("unknown action", where=where, found=action, wanted="add or clear")
        if not reason.strip():
            raise CardError("no reason", where=where, wanted="why the box is added or cleared")
        box = Detection.of(_kind(kind, where), _edges(edges, where), 1.0, "review", "")
        if not t_ns.isdigit():
            raise CardError("t_ns is no integer", where=where, found=t_ns)
        found[camera, int(t_ns)].append(Review(number, action, box, reason))
    return found


def reviewed(boxes: Sequence[Detection], reviews: Sequence[Review], where: object) -> list[Detection]:
    """The boxes without the cleared ones and with the added ones.

    Raises
    ------
    CardError
        For a line that clears nothing: the reviewer saw something that is not there any more.
    """
    kept = list(boxes)
    for review in reviews:
        if review.action == "clear":
            left = [box for box in kept if box.kind != review.box.kind or not _holds(review.box, box)]
            if len(left) == len(kept):
                raise CardError(
                    f"nothing to clear in line {review.line}", where=where, found=review.box.edges
                )
            kept = left
    return kept + [review.box for review in reviews if review.action == "add"]


def check_images(reviews: Mapping[Image, Sequence[Review]], images: set[Image], path: Path) -> None:
    """CardError for a line about an image that the sequence does not have."""
    for image, lines in reviews.items():
        if image not in images:
            raise CardError(
                "reviewed image is not in the frames", where=f"{path}:{lines[0].line}", found=image
            )


def _kind(text: str, where: str) -> Kind:
    if text == "face" or text == "plate":
        return "face" if text == "face" else "plate"
    raise CardError("unknown kind", where=where, found=text, wanted="face or plate")


def _edges(cells: Sequence[str], where: str) -> list[float]:
    try:
        edges = [float(cell) for cell in cells]
    except ValueError as error:
        raise CardError("edge is no number", where=where, found=",".join(cells)) from error
    if not all(map(math.isfinite, edges)) or edges[0] >= edges[2] or edges[1] >= edges[3]:
        raise CardError("box without an extent", where=where, found=edges)
    return edges


def _holds(outer: Detection, inner: Detection) -> bool:
    width = min(outer.x_max, inner.x_max) - max(outer.x_min, inner.x_min)
    height = min(outer.y_max, inner.y_max) - max(outer.y_min, inner.y_min)
    area = inner.size[0] * inner.size[1]
    return width > 0 and height > 0 and width * height >= _CLEARED_SHARE * area
