"""How much of what a person labelled was redacted."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.errors import CardError
from card.privacy.redaction import Area
from card.privacy.tables import Image

COLUMNS = ["camera", "t_ns", "kind", "x_min", "y_min", "x_max", "y_max"]


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
    settings: Mapping[str, Any],
    where: object,
) -> list[Figure]:
    """Share of labelled objects that are redacted, in percent, by kind and by height, with lower bounds.

    Parameters
    ----------
    areas, sizes : redacted areas and (width, height) by image.
    settings : ``recall`` of ``settings/privacy``.

    A kind without labels of the height that counts has no value, and so fails its gate.
    """
    figures = []
    for kind in ("face", "plate"):
        heights, covered = [], []
        for labelled in labels:
            if labelled.kind != kind:
                continue
            if labelled.image not in sizes:
                raise CardError("labelled image is not in the frames", where=where, found=labelled.image)
            share = covered_share(labelled, areas.get(labelled.image, ()), sizes[labelled.image], where)
            heights.append(labelled.y_max - labelled.y_min)
            covered.append(share >= settings["covered_share"])
        floor = settings["min_height_px"][kind]
        figures += _figures(kind, "", np.array(heights), np.array(covered), (floor, np.inf), settings)
        edges = [0.0, floor, *(edge for edge in settings["size_bins_px"] if edge > floor), np.inf]
        for low, high in pairwise(edges):
            name = f"_{low:g}_{high:g}px" if np.isfinite(high) else f"_{low:g}px"
            figures += _figures(kind, name, np.array(heights), np.array(covered), (low, high), settings)
    return figures


def _figures(
    kind: str,
    suffix: str,
    heights: NDArray[np.float64],
    covered: NDArray[np.bool_],
    within: tuple[float, float],
    settings: Mapping[str, Any],
) -> list[Figure]:
    chosen = covered[(heights >= within[0]) & (heights < within[1])] if len(heights) else covered
    hits, total = int(chosen.sum()), len(chosen)
    share, confidence = settings["covered_share"], settings["confidence"]
    which = f"{total} labelled {kind}s from {within[0]:g} to below {within[1]:g} px in height"
    return [
        Figure(
            f"recall_{kind}_pct{suffix}",
            100 * hits / total if total else None,
            "%",
            f"Share of the {which} with at least {share:.0%} of their pixels redacted.",
        ),
        Figure(
            f"recall_{kind}_pct_low{suffix}",
            100 * lower_bound(hits, total, confidence) if total else None,
            "%",
            f"Exact one-sided {confidence:.0%} lower bound of the share of the {which}.",
        ),
    ]
