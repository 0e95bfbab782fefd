"""Motion compensation: every LiDAR point is placed in the world with the pose of its own firing time."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import Trajectory, apply
from card.geometry.corrections import correct_points
from card.recording.burst import Burst


def deskew_burst(
    burst: Burst,
    rig_from_lidar: NDArray[np.float64],
    trajectory: Trajectory,
    corrections: Mapping[str, Any] | None = None,
    *,
    motion_compensate: bool = True,
    end_ns: int | None = None,
) -> NDArray[np.float64]:
    """World points (N, 3) float64, metres, of a burst's points (N, 3) in the sensor frame.

    Section A of the paper's supplement transforms a burst with the pose at its end; here the sensor's own
    motion during the sweep is removed first, point by point.

    Parameters
    ----------
    rig_from_lidar : (4, 4) extrinsic of the sensor.
    corrections : the sensor's entry of ``lidar_corrections`` in the calibration, if any.
    motion_compensate : False for a recording that is deskewed to the burst's end already.
    end_ns : end of the whole burst, where `burst` holds only some of its points; else that of its last point.

    Raises
    ------
    CardError
        If the trajectory does not cover the burst.
    """
    end = burst.end_ns if end_ns is None else end_ns
    if burst.t_ns < trajectory.start_ns or end > trajectory.end_ns:
        raise CardError(
            "poses do not cover the burst",
            where=f"burst {burst.t_ns}",
            found=f"poses {trajectory.start_ns}..{trajectory.end_ns} ns",
            wanted=f"{burst.t_ns}..{end} ns",
        )
    points = burst.points if corrections is None else correct_points(burst.points, burst.ring, corrections)
    points_rig = apply(rig_from_lidar, points)
    if not motion_compensate:
        return apply(trajectory.at(end), points_rig)
    # The channels of one column fire within microseconds and share times: interpolate each time once.
    times, inverse = np.unique(burst.time_ns, return_inverse=True)
    return apply(trajectory.at(times)[inverse], points_rig)
