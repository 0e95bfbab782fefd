"""Means over images or boxes, or over all their pixels, with intervals that resample whole sequences.

Frames of a sequence resemble each other, so a bootstrap over frames would make every interval too narrow: the
units resampled must be independent (B. Efron, R. Tibshirani, "An Introduction to the Bootstrap", 1993).
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.benchmark.pixel_metrics import MEANS, METRICS, SUMS, metrics_of

Array = NDArray[np.float64]

SEED = 0


def average(sums: Array, sequences: Sequence[str], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Summary of the images or boxes (N, len(SUMS)) of sequences (N,): a row of document `evaluation`.

    ``samples`` : how many the depth means are over. ``truth_pixels`` : pixels with ground truth;
    ``valid_share`` : share of them whose prediction lies in the range. ``metrics``, ``intervals`` : by name;
    None where no sample is, or where a single sequence leaves nothing to resample.
    """
    pooled = settings["profile"] == "pooled"
    names, code = np.unique(np.array(sequences, dtype=object).astype(str), return_inverse=True)
    each = metrics_of(sums)
    column = {name: sums[:, k] for k, name in enumerate(SUMS)}
    rng = np.random.default_rng(SEED)
    resamplings = settings["bootstrap_samples"] if len(names) > 1 else 0
    draws = rng.multinomial(len(names), np.full(max(1, len(names)), 1 / max(1, len(names))), resamplings)

    metrics: dict[str, float | None] = {}
    intervals: dict[str, list[float] | None] = {}
    for name in METRICS:
        source, root = MEANS[name]
        known = ~np.isnan(each[name])
        values = np.where(known, column[source] if pooled else each[name], 0.0)
        weights = np.where(known, column["pixels"] if pooled else 1.0, 0.0)
        # (names, 2): what each sequence adds to numerator and denominator.
        parts = np.stack(
            [np.bincount(code, weights=w, minlength=len(names)) for w in (values, weights)], axis=1
        )
        metrics[name] = None if not known.any() else _ratio(parts.sum(axis=0), root and pooled)
        intervals[name] = None
        if np.count_nonzero(parts[:, 1]) > 1 and len(draws):
            resampled = draws @ parts
            found = _ratio(resampled[resampled[:, 1] > 0].T, root and pooled)
            tail = (1 - settings["confidence"]) / 2
            intervals[name] = [float(edge) for edge in np.quantile(found, [tail, 1 - tail])]
    truth = column["truth"].sum()
    return {
        "samples": int(np.count_nonzero(column["pixels"])),
        "truth_pixels": int(truth),
        "valid_share": float(column["valid"].sum() / truth) if truth else None,
        "metrics": metrics,
        "intervals": intervals,
    }


def _ratio(parts: Any, root: bool) -> Any:
    mean = parts[0] / parts[1]
    return np.sqrt(mean) if root else mean
