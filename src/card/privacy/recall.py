"""How much of what a person labelled was redacted."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from card.artifacts import Figure
from card.errors import CardError
from card.privacy.redaction import Area

COLUMNS = ["camera", "t_ns", "kind", "x_min", "y_min", "x_max", "y_max"]
Image = tuple[str, int]  # camera, t_ns


class LabelledObject(NamedTuple):
    """A face or plate that a person marked: its box in pixels of the original image, centres at integers."""

    image: Image
    kind: str
    x_min: float
    y_min: float
    x_max: float
    y_max: float


def read_labels(path: Path) -> list[LabelledObject]:
    """Labelled objects of ``privacy_labels.csv``; ``CardError`` names the line that does not fit."""
    lines = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    if not lines or lines[0] != COLUMNS:
        raise CardError("wrong columns", where=path, found=lines[0] if lines else "nothing", wanted=COLUMNS)
    objects = []
    for number, cells in enumerate(lines[1:], 2):
        where = f"{path}:{number}"
        try:
            camera, t_ns, kind, *edges = cells
            box = [float(edge) for edge in edges]
            labelled = LabelledObject((camera, int(t_ns)), kind, *box)
        except (ValueError, TypeError) as error:
            raise CardError("row does not fit", where=where, found=",".join(cells), wanted=COLUMNS) from error
        if kind not in ("face", "plate"):
            raise CardError("unknown kind", where=where, found=kind, wanted="face or plate")
        if not all(map(math.isfinite, box)) or box[0] > box[2] or box[1] > box[3]:
            raise CardError("box without an extent", where=where, found=box)
        objects.append(labelled)
    return objects


def covered_share(
    labelled: LabelledObject, areas: Iterable[Area], size: tuple[int, int], where: object = None
) -> float:
    """Share of an object's pixels under the union of ``areas``; ``size`` is (width, height) of the image.

    A pixel belongs to the object when its centre lies in the box, and at least one always does.
    Raises ``CardError`` for an object outside the image.
    """
    x_min, x_end = _pixels(labelled.x_min, labelled.x_max, size[0])
    y_min, y_end = _pixels(labelled.y_min, labelled.y_max, size[1])
    if x_min >= x_end or y_min >= y_end:
        raise CardError(
            "labelled object outside the image", where=where, found=labelled[2:], wanted=f"within {size}"
        )
    covered = np.zeros((y_end - y_min, x_end - x_min), dtype=bool)
    for left, top, right, bottom in areas:
        rows = slice(max(top - y_min, 0), max(bottom - y_min, 0))
        columns = slice(max(left - x_min, 0), max(right - x_min, 0))
        covered[rows, columns] = True
    return float(covered.mean())


def _pixels(low: float, high: float, size: int) -> tuple[int, int]:
    first, end = math.ceil(low), math.floor(high) + 1
    if first >= end:
        first = round((low + high) / 2)
        end = first + 1
    return max(first, 0), min(end, size)


def lower_bound(hits: int, total: int, confidence: float) -> float:
    """One-sided lower bound of a proportion (Clopper and Pearson, Biometrika 1934, exact)."""
    from scipy.stats import beta

    return float(beta.ppf(1 - confidence, hits, total - hits + 1)) if hits else 0.0


def recall_figures(
    labels: Sequence[LabelledObject],
    areas: Mapping[Image, Sequence[Area]],
    sizes: Mapping[Image, tuple[int, int]],
    *,
    covered_share_wanted: float,
    confidence: float,
    where: object,
) -> list[Figure]:
    """Share of labelled objects that are redacted, in percent, by kind, each with its lower bound.

    ``areas`` and ``sizes`` (width, height) are by image; a kind without labels has no value, and so fails
    its gate.
    """
    figures = []
    for kind in ("face", "plate"):
        shares = []
        for labelled in labels:
            if labelled.kind != kind:
                continue
            if labelled.image not in sizes:
                raise CardError("labelled image is not in the frames", where=where, found=labelled.image)
            shares.append(
                covered_share(labelled, areas.get(labelled.image, ()), sizes[labelled.image], where)
            )
        hits, total = sum(share >= covered_share_wanted for share in shares), len(shares)
        wanted = f"at least {covered_share_wanted:.0%} of their pixels redacted"
        recall = 100 * hits / total if total else None
        low = 100 * lower_bound(hits, total, confidence) if total else None
        figures += [
            Figure(
                f"recall_{kind}_pct", recall, "%", f"Share of the {total} labelled {kind}s with {wanted}."
            ),
            Figure(
                f"recall_{kind}_pct_low",
                low,
                "%",
                f"Exact one-sided {confidence:.0%} lower bound of the share.",
            ),
        ]
    return figures
