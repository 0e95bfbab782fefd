"""What the boards of a session tell of the front LiDAR, for a drive that is simulated without its boards."""

from typing import Any

import numpy as np

from card.geometry import to_json
from card.simulation.rig import CAMERAS, CHANNELS, LidarCorrections, nominal_rig

#: The maker's tolerances of a channel, one sigma: range, m; elevation and azimuth, rad.
CHANNEL_M, CHANNEL_RAD = 0.0025, 0.00052


def front_lidar_document(true: LidarCorrections, sigma_m: float, rng: np.random.Generator) -> dict[str, Any]:
    """A ``front_lidar_calibration`` that knows the common range offset to sigma_m, of channels nothing.

    Its poses, views and quality are empty.
    """
    poses = ("left_from_right", *(f"lidar_front_from_{name}" for name in CAMERAS))
    camera = nominal_rig(100, 100).cameras["camera_left"].to_json()
    counts = ("views", "views_refused", "returns", "inliers", "starts", "starts_agreed")
    rms = ("board_plane_rms_m", "range_sigma_m", "reprojection_rms_px", "corner_sigma_px")
    witnesses = ("split_half_deg", "split_half_mm", "closed_form_deg", "closed_form_mm")
    return {
        "schema": "front_lidar_calibration",
        "cameras": dict.fromkeys(CAMERAS, camera),
        **{name: to_json(np.eye(4)) for name in poses},
        "corrections": _document(true.range_offset_m + rng.normal(0, sigma_m), 0.0, 0.0),
        "sigmas": _document(sigma_m, CHANNEL_M, CHANNEL_RAD),
        "covariances": {
            **{name: np.eye(9).tolist() for name in CAMERAS},
            **{name: np.eye(6).tolist() for name in poses},
            "together": np.eye(30).tolist(),
        },
        "views": [],
        "quality": dict.fromkeys(counts, 0) | dict.fromkeys((*rms, *witnesses), 0.0),
        "verdict": {"passed": True, "reasons": []},
    }


def _document(common: float, channel_m: float, channel_rad: float) -> dict[str, Any]:
    return {
        "range_offset_m": float(common),
        "channel_range_offset_m": [channel_m] * CHANNELS,
        "channel_elevation_offset_rad": [channel_rad] * CHANNELS,
        "channel_azimuth_offset_rad": [channel_rad] * CHANNELS,
    }
