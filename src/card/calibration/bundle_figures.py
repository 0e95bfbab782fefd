"""What a bundle says of itself, as figures of a report."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from card.artifacts import Figure
from card.calibration.checks import baseline


def bundle_figures(bundle: Mapping[str, Any]) -> list[Figure]:
    """Figures of a document of schema ``calibration``."""
    quality = bundle["quality"]
    sigmas = [
        Figure(
            f"sigma_{name.removeprefix('rig_from_')}_mm",
            1e3 * float(np.sqrt(max(np.trace(np.asarray(rows)[:3, :3]), 0.0))),
            "mm",
            f"standard deviation of the position in {name}, as the bundle states it",
        )
        for name, rows in sorted(bundle["covariances"].items())
        if name.startswith("rig_from_")
    ]
    found = [
        Figure("baseline_m", float(baseline(bundle["extrinsics"])[0]), "m", "stereo baseline along x"),
        Figure(
            "stereo_reprojection_px",
            quality["stereo_reprojection_px"],
            "px",
            "rms reprojection error of the stereo calibration, as the bundle states it",
        ),
        Figure(
            "board_plane_rms_mm",
            1e3 * quality["board_plane_rms_m"],
            "mm",
            "rms distance of board returns to the board planes, as the bundle states it",
        ),
        *sigmas,
        Figure(
            "failed_limits",
            float(len(quality.get("failed_limits", ()))),
            "1",
            "limits of its steps that an estimated bundle does not keep",
        ),
    ]
    if "wheels" in bundle["covariances"]:
        variance = np.diag(bundle["covariances"]["wheels"]).reshape(-1, 2, 3)[:, 1]
        found.append(
            Figure(
                "sigma_wheel_contact_mm",
                1e3 * float(np.sqrt(variance.sum(axis=-1).max())),
                "mm",
                "largest standard deviation of a wheel contact in the rig",
            )
        )
    if "wheel_spread_m" in quality:
        found.append(
            Figure(
                "wheel_spread_mm",
                1e3 * quality["wheel_spread_m"],
                "mm",
                "largest distance of a wheel point of one survey to the mean",
            )
        )
    return found
