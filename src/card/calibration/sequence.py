"""The calibration of a sequence: a bundle that was delivered or estimated, checked in the same way."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import write_json, write_report
from card.artifacts.masks import read_ego_mask, write_ego_mask
from card.calibration.bundle_figures import bundle_figures
from card.calibration.checks import check_bundle

MASK = "ego_mask.png"


def write_calibration(
    bundle: dict[str, Any],
    source: Path,
    session: Path,
    *,
    calibration: Path,
    ego_mask: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Check a bundle read from ``source`` and write it with the mask of its session.

    session : raw folder with, if the car is in the picture, ``ego_mask.png`` (8 bit, one channel, 255 = car,
        size of ``camera_left_undistorted``).
    calibration, ego_mask, report : the files to write.

    Raises
    ------
    CardError
        For a bundle that cannot be true; see `check_bundle`.
    """
    check_bundle(bundle, settings, source)
    image = bundle["camera_left_undistorted"]
    inputs, notes = {"calibration": source}, list(bundle["quality"].get("failed_limits", ()))
    if (session / MASK).is_file():
        inputs["ego_mask"] = session / MASK
        mask = read_ego_mask(session / MASK, image["width"], image["height"])
    else:
        mask = np.zeros((image["height"], image["width"]), dtype=np.uint8)
        notes.append(f"{session.name} has no {MASK}: the mask is empty, the car's own parts stay in")

    write_json(calibration, bundle, "calibration")
    write_ego_mask(ego_mask, mask)
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs=inputs,
        counts={"views": bundle["quality"]["views"], "ego_pixels": int(np.count_nonzero(mask))},
        figures=bundle_figures(bundle),
        gates=gates,
        notes=notes,
    )
