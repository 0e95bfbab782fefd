"""The individual calibration parameters of a LiDAR: range and angle offsets a channel."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray


def correct_points(
    points: NDArray[np.float64], ring: NDArray[np.uint8], corrections: Mapping[str, Any]
) -> NDArray[np.float64]:
    """Corrected points (N, 3), metres, of raw points (N, 3) in the sensor frame.

    A point at the origin stays there.

    Parameters
    ----------
    ring : (N,) channel of each point, 0 at the top.
    corrections : ``range_offset_m``, ``channel_range_offset_m`` [32], ``channel_elevation_offset_rad`` [32],
        ``channel_azimuth_offset_rad`` [32] (clockwise seen from above), all added to the measured values.
    """
    x, y, z = points.T
    flat = np.hypot(x, y)
    distance = np.hypot(flat, z)
    offset = np.asarray(corrections["channel_range_offset_m"]) + corrections["range_offset_m"]
    scale = 1.0 + offset[ring] / np.where(distance > 0, distance, np.inf)
    # Turning by the offsets spares the angles themselves, whose arctangents take most of the time.
    up = np.asarray(corrections["channel_elevation_offset_rad"])
    cos_up, sin_up = np.cos(up)[ring], np.sin(up)[ring]
    clockwise = np.asarray(corrections["channel_azimuth_offset_rad"])
    cos_az, sin_az = np.cos(clockwise)[ring], np.sin(clockwise)[ring]
    stretch = scale * (cos_up - sin_up * np.divide(z, flat, out=np.zeros_like(z), where=flat > 0))
    return np.stack(
        [
            stretch * (x * cos_az + y * sin_az),
            stretch * (y * cos_az - x * sin_az),
            scale * (z * cos_up + flat * sin_up),
        ],
        axis=1,
    )
