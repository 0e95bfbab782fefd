"""Predictions that are well-formed but cannot be what they are said to be: another unit, another camera.

Both are looked for on a few frames before the evaluation starts.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.benchmark.image_space import SPACES, ImageSpace, image_space
from card.errors import CardError
from card.geometry import apply
from card.packaging.reader.rig import Rig

Array = NDArray[np.float64]

CAMERAS = ("camera_left", "camera_right")
PROBES, PROBE_POINTS = 3, 50_000
#: Ratios of the medians of prediction and truth that millimetres taken for metres have.
MILLIMETRES = (500.0, 2000.0)
#: A space that fits so many times better than the declared one is the true one ...
CLEARLY = 2.0
#: ... unless the declared one fits this well already: spread of log depth, 1.
GOOD_FIT = 0.01
SPREAD_QUANTILE = 0.9


def check_unit(ratios: Sequence[float], where: object) -> None:
    """CardError if the median ratio of prediction and truth says that depth is in millimetres."""
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    if known and MILLIMETRES[0] <= (ratio := float(np.median(known))) <= MILLIMETRES[1]:
        raise CardError(
            "depth in millimetres taken for metres",
            where=where,
            found=f"predictions {ratio:.0f} times the truth",
            wanted="metres, or a declared unit of 0.001",
        )


def check_camera(probes: Sequence[tuple[Any, Any, Rig]], declared: str, where: object) -> None:
    """CardError if the predictions fit the truth in another image clearly better than in the declared one.

    probes : prediction (H, W), ground truth (N, 3) in camera_left and rig of some frames. The fit is
    how little the ratio of prediction and truth varies within a frame, so that a method's scale has no say.
    """
    fits: dict[tuple[str, str], list[float]] = {}
    for prediction, points, rig in probes:
        for camera in CAMERAS:
            truth, rays = _seen_by(points, rig, camera)
            for name in SPACES:
                space = image_space(name, rig, camera)
                if prediction.shape == (space.camera.height, space.camera.width):
                    fits.setdefault((camera, name), []).append(_spread(space, prediction, truth, rays))
    means = {key: float(np.mean(values)) for key, values in fits.items() if np.isfinite(values).all()}
    claimed = means.get(("camera_left", declared))
    if claimed is None or claimed <= GOOD_FIT:
        return
    best = min(means, key=lambda key: means[key])
    if means[best] * CLEARLY < claimed:
        raise CardError(
            "predictions of the wrong camera or image space",
            where=where,
            found=f"they fit the {best[1]} image of {best[0]} (spread {means[best]:.2g}, not {claimed:.2g})",
            wanted=f"the {declared} image of camera_left",
        )


def _seen_by(points: Any, rig: Rig, camera: str) -> tuple[Array, Array]:
    """Depth (M,) and rays (M, 2) with z = 1 of some points of the ground truth that a camera sees."""
    some = np.asarray(points[:: max(1, len(points) // PROBE_POINTS)], dtype=np.float64)
    moved = apply(rig.transform(f"{camera}_from_camera_left", {}), some)
    model = rig.camera(camera)
    moved = moved[model.contains(model.project(moved))]
    return moved[:, 2], moved[:, :2] / moved[:, 2:]


def _spread(space: ImageSpace, prediction: Any, truth: Array, rays: Array) -> float:
    """Spread of log(prediction / truth) about its median; NaN where no pixel has both."""
    predicted, _ = space.sample(prediction, rays)
    given = predicted > 0
    if not given.any():
        return float("nan")
    log = np.log(predicted[given] / truth[given])
    return float(np.quantile(np.abs(log - np.median(log)), SPREAD_QUANTILE))
