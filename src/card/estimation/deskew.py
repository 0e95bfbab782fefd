"""Motion compensation: every LiDAR point is placed in the world with the pose of its own firing time."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.estimation.deskew_kernel import place
from card.geometry import Trajectory, apply
from card.geometry.corrections import correct_points
from card.recording.burst import Burst
from card.recording.hesai.packet import CHANNELS


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
    motion during the sweep is removed first, point by point. `deskew_plain` is the same in plain numpy; they
    agree to the rounding of float64, as their sines come from two libraries.

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
    if burst.t_ns < trajectory.start_ns or max(end, burst.end_ns) > trajectory.end_ns:
        raise CardError(
            "poses do not cover the burst",
            where=f"burst {burst.t_ns}",
            found=f"poses {trajectory.start_ns}..{trajectory.end_ns} ns",
            wanted=f"{burst.t_ns}..{max(end, burst.end_ns)} ns",
        )
    if not motion_compensate:
        return apply(trajectory.at(end), _in_rig(burst, rig_from_lidar, corrections))
    # The knots round the burst's times; at the end of the trajectory the last interval.
    low = min(int(np.searchsorted(trajectory.t_ns, burst.t_ns, side="right")), len(trajectory.t_ns) - 1) - 1
    knots = slice(low, max(int(np.searchsorted(trajectory.t_ns, burst.end_ns, side="left")), low + 1) + 1)
    return np.asarray(
        place(
            np.ascontiguousarray(burst.points),
            burst.ring,
            burst.offset_ns,
            turns_of(corrections),
            np.ascontiguousarray(rig_from_lidar),
            trajectory.t_ns[knots] - burst.t_ns,
            trajectory.translation_m[knots],
            trajectory.rotation_wxyz[knots],
        )
    )


def deskew_plain(
    burst: Burst,
    rig_from_lidar: NDArray[np.float64],
    trajectory: Trajectory,
    corrections: Mapping[str, Any] | None = None,
) -> NDArray[np.float64]:
    """The reference of `deskew_burst`: correct, take to the rig, and apply one interpolated pose a point."""
    return apply(trajectory.at(burst.time_ns), _in_rig(burst, rig_from_lidar, corrections))


def _in_rig(
    burst: Burst, rig_from_lidar: NDArray[np.float64], corrections: Mapping[str, Any] | None
) -> NDArray[np.float64]:
    points = burst.points if corrections is None else correct_points(burst.points, burst.ring, corrections)
    return apply(rig_from_lidar, points)


def turns_of(corrections: Mapping[str, Any] | None) -> NDArray[np.float64]:
    """(32, 5) a channel: offset of the range, cosine and sine of the offsets of elevation and azimuth."""
    if corrections is None:
        return np.tile([0.0, 1.0, 0.0, 1.0, 0.0], (CHANNELS, 1))
    up, clockwise = (
        np.asarray(corrections[f"channel_{angle}_offset_rad"]) for angle in ("elevation", "azimuth")
    )
    offset = np.asarray(corrections["channel_range_offset_m"]) + corrections["range_offset_m"]
    return np.stack([offset, np.cos(up), np.sin(up), np.cos(clockwise), np.sin(clockwise)], axis=1)
