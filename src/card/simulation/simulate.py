"""One drive from nothing to files: the raw recording as a car would leave it, and the truth beside it."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml

from card.artifacts import atomic_folder, check, write_arrays, write_table
from card.errors import CardError
from card.geometry import Trajectory
from card.recording.paths import imu_path
from card.simulation.deliveries import as_bag, write_trajectory
from card.simulation.drives import drive_named
from card.simulation.footprint import wheel_contacts
from card.simulation.frame_truth import write_frame_truth
from card.simulation.imu import ImuErrors, imu_times, measured_imu
from card.simulation.record import write_photographs, write_sweeps
from card.simulation.rig import CAMERAS, LIDARS, WHEELS
from card.simulation.world import World, build_world


def simulate_drive(
    drive: str,
    *,
    recording: Path,
    truth: Path,
    scale: str,
    seed: int,
    dual_returns: bool = False,
    threads: int = 1,
) -> None:
    """Write the raw recording of a demo drive to ``recording`` and its truth to ``truth``.

    Parameters
    ----------
    drive : id of one of `drives.DRIVES`.
    scale : ``tiny``, ``demo`` or ``full``.
    seed : makes the world; the same seed gives the same bytes.
    dual_returns : LiDARs report the last return of a beam beside the strongest one.
    threads : processes that share the sensors' work; the bytes do not depend on it.

    Raises
    ------
    CardError
        For an unknown drive or scale, for dual returns of a drive that is delivered as a bag, or if a folder
        cannot be written; a folder appears whole or not at all.
    """
    if dual_returns and drive_named(drive).bag:
        raise CardError("a simulated bag holds single returns", where=drive, found="simulation.dual_returns")
    world = build_world(drive, scale, seed)
    with atomic_folder(truth) as truth_part, atomic_folder(recording) as recording_part:
        native = recording_part / "native" if world.drive.bag else recording_part
        path = write_motion(world, native, truth_part)
        write_sweeps(world, native, truth_part, threads, dual_returns=dual_returns)
        write_photographs(world, native, truth_part, threads)
        write_description(world, native)
        if world.drive.bag:
            as_bag(native, recording_part)
            shutil.rmtree(native)
        write_trajectory(recording_part, path, seed)


def write_motion(world: World, recording: Path, truth: Path) -> Trajectory:
    """IMU table, true trajectory, wheels, frames and mesh; the true trajectory at IMU rate is returned."""
    times = imu_times(world.start_ns, world.scale.duration_s)
    measured = measured_imu(world.path, times, ImuErrors(), world.rig.imu, world.rng("imu"))
    write_table(imu_path(recording), measured, "imu")
    rows = np.searchsorted(world.path.t_ns, times)
    path = Trajectory(times, world.path.translation_m[rows], world.path.rotation_wxyz[rows])
    write_table(truth / "trajectory.parquet", path.to_table(), "trajectory")
    guess = np.interp((times - world.start_ns) * 1e-9, world.course.t, world.course.s)
    contacts = [wheel_contacts(world.road, path, world.rig.wheel_contact_m[wheel], guess) for wheel in WHEELS]
    columns = {
        "wheel": np.repeat(WHEELS, len(times)),
        "t_ns": np.tile(times, len(WHEELS)),
        **{axis: np.concatenate([c[:, i] for c in contacts]) for i, axis in enumerate("xyz")},
        **{f"q{axis}": np.tile(path.rotation_wxyz[:, i], len(WHEELS)) for i, axis in enumerate("wxyz")},
    }
    write_table(truth / "wheels.parquet", columns, "truth_wheels")
    mesh = world.static
    write_arrays(
        truth / "world.npz",
        {"vertices": mesh.vertices, "triangles": mesh.triangles, "surface": mesh.surface},
        "truth_world",
    )
    write_frame_truth(world, truth)
    return path


def write_description(world: World, recording: Path, cameras: Sequence[str] = CAMERAS) -> None:
    """recording.yaml of a drive with both LiDARs, the IMU and these cameras."""
    clock = {"clock": "synchronised"}
    period = 100_000_000 // world.scale.columns
    lidar = {"model": "PandarXT-32", **clock, "deskewed": False, "column_period_ns": period}
    camera = {"model": "simulated 5 MP global shutter", **clock}
    document = {
        "id": world.name,
        "rig": "simulated-macan",
        "day": world.drive.day,
        "place": world.drive.place,
        "country": world.drive.country,
        "sensors": {
            # A dict of its own for each: YAML would tie shared ones together with anchors.
            **{name: dict(camera) for name in cameras},
            **{name: dict(lidar) for name in LIDARS},
            "imu": {"model": "simulated MEMS, 200 Hz", **clock},
        },
    }
    check(document, "recording", recording / "recording.yaml")
    text = yaml.safe_dump(document, sort_keys=False)
    (recording / "recording.yaml").write_text(text, encoding="utf-8")
