"""The individual calibration parameters of a LiDAR: range and angle offsets a channel."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def correct_points(
    points: NDArray[np.float64], ring: NDArray[np.uint8], corrections: Mapping[str, Any]
) -> NDArray[np.float64]:
    """Corrected points (N, 3), metres, of raw points (N, 3) in the sensor frame.

    Parameters
    ----------
    ring : (N,) channel of each point, 0 at the top.
    corrections : ``range_offset_m``, ``channel_range_offset_m`` [32], ``channel_elevation_offset_rad`` [32],
        ``channel_azimuth_offset_rad`` [32] (clockwise seen from above), all added to the measured values.
    """
    horizontal = np.hypot(points[:, 0], points[:, 1])
    distance = np.hypot(horizontal, points[:, 2]) + corrections["range_offset_m"]
    distance += np.asarray(corrections["channel_range_offset_m"])[ring]
    elevation = np.arctan2(points[:, 2], horizontal)
    elevation += np.asarray(corrections["channel_elevation_offset_rad"])[ring]
    azimuth = np.arctan2(points[:, 0], points[:, 1])
    azimuth += np.asarray(corrections["channel_azimuth_offset_rad"])[ring]
    flat = distance * np.cos(elevation)
    return np.stack([flat * np.sin(azimuth), flat * np.cos(azimuth), distance * np.sin(elevation)], axis=1)
