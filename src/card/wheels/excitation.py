"""The wheels stage: ground contact of each wheel over time and the road plane of each frame."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import (
    Figure,
    read_arrays,
    read_json,
    read_table,
    write_json,
    write_report,
    write_table,
)
from card.artifacts.processes import in_processes
from card.geometry import Trajectory, from_json
from card.recording.description import read_description
from card.wheels.arc_height import Corridor
from card.wheels.contact_path import contact_path
from card.wheels.profile import SplineSettings
from card.wheels.road_plane import RoadPlanes
from card.wheels.samples import BurstFile, Cutter, Lidar, collect_samples, spaced_bursts
from card.wheels.static_points import StaticVoxels
from card.wheels.tables import excitation_document, frame_planes, plane_columns
from card.wheels.wheel_fit import Excitation, QualitySettings, fit_excitation

WHEELS = ("fl", "fr", "rl", "rr")


def excite(
    *,
    recording: Path,
    bursts: Path,
    frames: Path,
    calibration: Path,
    trajectory: Path,
    static_voxels: Path,
    wheel_excitation: Path,
    road_planes: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
    threads: int,
) -> None:
    """Fit the road under each wheel and write the excitation and the road planes of a sequence.

    Paper, "Wheel Excitation" and its supplement; "Height Evaluation Metrics" for the plane.

    Parameters
    ----------
    recording : folder with the bursts.
    bursts, frames, calibration, trajectory, static_voxels : artifacts of the schemas of these names.
    wheel_excitation, road_planes, report : the files to write.
    threads : processes that share the bursts and the wheels; the bytes do not depend on it.

    Raises
    ------
    CardError
        For inputs that do not fit their schemas, or a trajectory that does not cover a burst or frame.
    """
    path = Trajectory.from_table(read_table(trajectory, "trajectory"))
    bundle = read_json(calibration, "calibration")
    paths = {
        name: contact_path(path, bundle["wheels"][name]["contact_m"], settings["min_step_m"])
        for name in WHEELS
    }
    description = read_description(recording)
    spacing = settings["points_per_m"], settings["min_step_m"]
    files = spaced_bursts(_burst_files(bursts, recording), paths["fl"], *spacing)
    cutter = Cutter(
        _lidars(bundle, description),
        path,
        list(paths.values()),
        StaticVoxels(read_arrays(static_voxels, "static_voxels")),
        settings["static_reach_voxels"],
        Corridor(
            settings["corridor_half_width_m"],
            settings["max_height_m"],
            overhang_m=settings["footprint_m"] / 2 + settings["min_step_m"],
        ),
        settings["arc_window_m"],
    )
    samples = collect_samples(files, cutter, threads)
    spline = SplineSettings(**{name: settings[name] for name in SplineSettings.__dataclass_fields__})
    quality = QualitySettings(**{name: settings[name] for name in QualitySettings.__dataclass_fields__})
    fits = [
        (paths[name], road, spline, quality, settings["footprint_m"])
        for name, road in zip(WHEELS, samples, strict=True)
    ]
    found = in_processes(lambda wheel: fit_excitation(*fits[wheel]), range(len(WHEELS)), threads)
    wheels = dict(zip(WHEELS, found, strict=True))

    table = read_table(frames, "frames")
    t_ns = np.asarray(table["t_ns"], dtype=np.int64)
    planes, std = frame_planes(wheels, path, t_ns)
    valid = (std <= settings["max_plane_std_m"]) & (planes.residual_m <= settings["max_plane_residual_m"])

    write_json(wheel_excitation, excitation_document(wheels, path), "wheel_excitation")
    write_table(road_planes, plane_columns(np.asarray(table["frame"]), t_ns, planes, valid), "road_planes")
    write_report(
        report,
        stage="wheels",
        sequence=description["id"],
        settings=settings,
        inputs={
            "bursts": bursts,
            "frames": frames,
            "calibration": calibration,
            "trajectory": trajectory,
            "static_voxels": static_voxels,
        },
        counts={
            "bursts": len(files),
            "samples": len(path.t_ns),
            "frames": len(t_ns),
            **{f"points_{name}": len(road) for name, road in zip(WHEELS, samples, strict=True)},
        },
        figures=_figures(wheels, planes, valid),
        gates=gates,
    )


def _burst_files(bursts: Path, recording: Path) -> list[BurstFile]:
    table = read_table(bursts, "bursts")
    columns = (table[name].to_pylist() for name in ("lidar", "t_start_ns", "points", "file"))
    files = [
        BurstFile(lidar, t_ns, points, f"{recording}/{file}")
        for lidar, t_ns, points, file in zip(*columns, strict=True)
    ]
    return sorted(files, key=lambda file: (file.t_start_ns, file.lidar))


def _lidars(bundle: Mapping[str, Any], description: Mapping[str, Any]) -> dict[str, Lidar]:
    return {
        name: Lidar(
            from_json(bundle["extrinsics"][f"rig_from_{name}"]),
            corrections,
            description["sensors"].get(name, {}).get("deskewed", False),
        )
        for name, corrections in bundle["lidar_corrections"].items()
    }


def _figures(wheels: Mapping[str, Excitation], planes: RoadPlanes, valid: NDArray[np.bool_]) -> list[Figure]:
    gap = np.concatenate([wheel.gap for wheel in wheels.values()])
    uncertain = np.concatenate([wheel.uncertain & ~wheel.gap for wheel in wheels.values()])
    points, residual, std = (
        np.concatenate([getattr(wheel, name)[wheel.measured] for wheel in wheels.values()])
        for name in ("points", "residual_m", "std_m")
    )
    return [
        Figure("gap_pct", 100 * float(gap.mean()), "%", "samples with too few LiDAR points near"),
        Figure(
            "uncertain_pct", 100 * float(uncertain.mean()), "%", "other samples whose points say too little"
        ),
        Figure("points_near", _median(points), "1", "median number of points near a measured sample"),
        Figure("std_mm", _median(1e3 * std), "mm", "median standard deviation of a measured sample"),
        Figure(
            "residual_mm", _median(1e3 * residual), "mm", "median rms distance of the points from the spline"
        ),
        Figure(
            "plane_residual_mm", _median(1e3 * planes.residual_m), "mm", "median residual of the road planes"
        ),
        Figure(
            "plane_valid_pct",
            100 * float(valid.mean()) if len(valid) else None,
            "%",
            "frames with a valid road plane",
        ),
    ]


def _median(values: NDArray[Any]) -> float | None:
    return float(np.median(values)) if len(values) else None
