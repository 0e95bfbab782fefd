"""The short drive of a calibration session: rounds on a yard, for the rear LiDAR and the IMU."""

from dataclasses import replace
from pathlib import Path

from card.simulation.calibrations import day_of
from card.simulation.drives import DRIVES, TOWN, Drive
from card.simulation.record import write_sweeps
from card.simulation.scales import scale_named
from card.simulation.simulate import write_description, write_motion
from card.simulation.world import world_of

# Time of day, h UTC.
_HOURS = {"start": 8.75, "mid": 12.75, "end": 17.75}


def write_session_drive(
    session: str, *, folder: Path, truth: Path, scale: str, seed: int, threads: int = 1
) -> None:
    """Write a session's drive: LiDARs, IMU and recording.yaml to `folder`, its truth to `truth`.

    The car goes round a block and over bumps, so that every axis of the IMU is excited.
    threads : processes that share the work; the bytes do not depend on it.
    """
    day, part = day_of(session)
    drive = Drive(
        session=session,
        starts=_HOURS[part],
        country=next((d.country for d in DRIVES.values() if d.day == day), "DE"),
        place="calibration yard",
        section=TOWN,
        road_class="C",
        speeds=((0, 4.0), (4, 6.0), (12, 3.0), (20, 6.0), (60, 5.0)),
        circuit=(25.0, 12.0),
        bump_spacing=20.0,
        house_depth=6.0,
    )
    size = scale_named(scale)
    size = replace(size, duration_s=size.session_s, camera_start_s=0.0)
    world = world_of(f"{session}-drive", drive, size, seed)
    folder.mkdir(parents=True)
    truth.mkdir(parents=True)
    write_motion(world, folder, truth)
    write_sweeps(world, folder, truth, threads)
    write_description(world, folder, cameras=())
