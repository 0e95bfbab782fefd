"""What every trajectory goes through, wherever it is from: checks, the world frame, poses of all members."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure, read_json, read_table, write_json, write_report, write_table
from card.estimation.imu import Imu
from card.estimation.imu_checks import imu_figures
from card.geometry import Trajectory, inverse, quaternion_from_matrix
from card.poses.anchor import anchor, tilt_deg
from card.poses.inputs import open_imu
from card.poses.map_quality import map_figures
from card.poses.members import pose_document, read_members
from card.poses.plausibility import check_coverage, check_motion, check_upright
from card.recording.description import read_description
from card.recording.paths import imu_path

Array = NDArray[np.float64]
WORLD_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Source:
    """A trajectory as it came: times (N,) ns, poses (N, 4, 4) of a sensor in a frame whose up is (3,).

    path : its file.
    """

    path: Path
    t_ns: NDArray[np.int64]
    from_sensor: Array
    rig_from_sensor: Array
    up: Array


def write_poses(
    source: Source,
    *,
    recording: Path,
    calibration: Path,
    bursts: Path,
    frames: Path,
    trajectory: Path,
    poses: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Check a trajectory, bring it to ``world`` and the IMU's times, and write it and all members' poses.

    Parameters
    ----------
    recording : folder with ``recording.yaml`` and, if the car has an IMU, ``imu.parquet``.
    calibration, bursts, frames : artifacts of schemas ``calibration``, ``bursts`` and ``frames``.
    trajectory, poses, report : the files to write, of schemas ``trajectory``, ``poses`` and ``report``.

    Raises
    ------
    CardError
        For a trajectory no car can drive, a wrong frame, axis or quaternion order, or bursts and images that
        are not covered.
    """
    t_ns, where = source.t_ns, source.path
    check_upright(source.from_sensor, source.rig_from_sensor, source.up, settings["max_tilt_deg"], where)
    world_from_rig = anchor(source.from_sensor @ inverse(source.rig_from_sensor), source.up)
    motion = check_motion(t_ns, world_from_rig[:, :3, 3], settings, where)
    burst_table = read_table(bursts, "bursts")
    members = read_members(burst_table, read_table(frames, "frames"))
    check_coverage((int(t_ns[0]), int(t_ns[-1])), {**members.bursts, **members.images}, where)

    anchored = Trajectory(t_ns, world_from_rig[:, :3, 3], quaternion_from_matrix(world_from_rig[:, :3, :3]))
    inputs = {"trajectory": where, "calibration": calibration, "bursts": bursts, "frames": frames}
    figures = _figures(t_ns, world_from_rig, motion)
    notes = []
    result = anchored
    if imu_path(recording).is_file():
        inputs["imu"] = imu_path(recording)
        imu = open_imu(recording, calibration, anchored.start_ns, anchored.end_ns)
        imu_agreement, causes = imu_figures(imu, anchored, settings["imu_window_s"])
        figures += imu_agreement
        notes += causes
        result = _resample(anchored, imu, settings["max_gap_s"])
    else:
        notes.append("no IMU: the trajectory keeps its delivered times and gravity is not checked")
    description = read_description(recording)
    document = read_json(calibration, "calibration")
    figures += map_figures(recording, burst_table, document, description["sensors"], result, settings)

    rate_hz = (len(t_ns) - 1) / float((t_ns[-1] - t_ns[0]) * 1e-9)
    if rate_hz < 0.99 * settings["min_rate_hz"]:
        notes.append(f"poses were delivered at {rate_hz:.0f} Hz: between them the path is a straight line")

    write_table(trajectory, result.to_table(), "trajectory")
    write_json(poses, pose_document(members, result), "poses")
    write_report(
        report,
        stage="poses",
        sequence=description["id"],
        settings=settings,
        inputs=inputs,
        counts={"delivered_poses": len(t_ns), "poses": len(result.t_ns)},
        figures=figures,
        gates=gates,
        notes=notes,
    )


def _resample(anchored: Trajectory, imu: Imu, max_gap_s: float) -> Trajectory:
    """The trajectory at the IMU's times; where the IMU has a gap, delivered poses stay."""
    after = np.searchsorted(imu.t_ns, anchored.t_ns, side="left")
    ends = np.concatenate([[np.iinfo(np.int64).min // 2], imu.t_ns, [np.iinfo(np.int64).max // 2]])
    in_gap = ends[after + 1] - ends[after] > max_gap_s * 1e9
    times = np.union1d(imu.t_ns, anchored.t_ns[in_gap])
    poses = anchored.at(times)
    return Trajectory(times, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3]))


def _figures(
    t_ns: NDArray[np.int64], world_from_rig: NDArray[np.float64], motion: Mapping[str, float]
) -> list[Figure]:
    span_s = float(t_ns[-1] - t_ns[0]) / 1e9
    length = float(np.linalg.norm(np.diff(world_from_rig[:, :3, 3], axis=0), axis=1).sum())
    return [
        Figure("duration_s", span_s, "s", "span of the delivered trajectory"),
        Figure("length_m", length, "m", "length of the delivered trajectory"),
        Figure("delivered_rate_hz", (len(t_ns) - 1) / span_s, "Hz", "mean rate of the delivered trajectory"),
        Figure("max_gap_s", motion["max_gap_s"], "s", "longest time between delivered poses"),
        Figure("max_speed_m_s", motion["max_speed_m_s"], "m/s", "greatest speed of the rig"),
        Figure(
            "median_tilt_deg",
            float(np.median(tilt_deg(world_from_rig, WORLD_UP))),
            "deg",
            "median angle between the rig's z and up",
        ),
    ]
