"""What a drive holds, in words and three pictures: from above, one sweep of each LiDAR, and a stereo pair."""

from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder
from card.errors import CardError
from card.simulation.bodies import ego_body
from card.simulation.lidar import Lidar, burst_starts
from card.simulation.photographs import exposures
from card.simulation.preview_pictures import stereo_pair, sweep, top_view
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import LIDARS
from card.simulation.world import World, build_world

Array = NDArray[np.float64]


def preview(drive: str, *, folder: Path, scale: str, seed: int, at_s: float | None = None) -> str:
    """Write top_view.png, sweep.png and stereo.png of a drive to ``folder``; what it holds, in words.

    at_s : moment of the nearest image, s after the recording's start; by default a second after the first.

    Raises
    ------
    CardError
        For an unknown drive or scale, a time without images, or if ``folder`` exists.
    """
    world = build_world(drive, scale, seed)
    times = np.array(exposures(world, "camera_left"))
    first, last = (times[[0, -1]] - world.start_ns) * 1e-9
    at_s = min(first + 1.0, last) if at_s is None else at_s
    if not first - 0.05 <= at_s <= last + 0.05:
        raise CardError(
            f"drive {drive} has no images at this time",
            found=f"{at_s:g} s",
            wanted=f"{first:g} to {last:g} s",
        )
    number = round((at_s - first) * 10)
    now = int(times[number])
    tracer, ego = Tracer(world.static, world.movers), Scene(ego_body())
    with atomic_folder(folder) as part:
        top_view(world, tracer, now, part / "top_view.png")
        clouds = {name: _burst(world, tracer, ego, name, now) for name in LIDARS}
        sweep(world, clouds, now, part / "sweep.png")
        stereo_pair(world, tracer, ego, number, part / "stereo.png")
    return contents(world)


def contents(world: World) -> str:
    """What a drive's world and trip hold, a few lines of text."""
    t, s = world.course.t, world.course.s
    during = (t >= 0) & (t <= world.scale.duration_s)
    speed = np.gradient(s, t)[during]
    kinds = Counter(thing.kind for thing in world.things)
    drive, road = world.drive, world.road
    closed = ", closed" if road.line.closed else ""
    bodies = sum(len(m.mesh.triangles) for m in world.movers)
    lines = [
        f"{world.name}, seed {world.seed}, {world.scale.name}: {drive.place} ({drive.country}), "
        f"{'night' if drive.night else 'day'}",
        f"  trip        {world.scale.duration_s:g} s, {np.ptp(s[during]):.0f} m, "
        f"{speed.min():.1f} to {speed.max():.1f} m/s, standing {np.mean(speed < 0.05):.0%} of the time",
        f"  cameras     {world.scale.camera_duration_s:g} s from {world.scale.camera_start_s:g} s on",
        f"  road        {'paved' if drive.section.paved else 'gravel'}, ISO 8608 class {drive.road_class}, "
        f"{road.line.length:.0f} m{closed}",
        "  on it       " + ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())),
        f"  moving      {len(world.cars)} cars, {len(world.walkers)} walkers; {len(world.movers)} bodies",
        f"  triangles   {len(world.static.triangles)} standing, {bodies} moving",
    ]
    return "\n".join(lines)


def _burst(world: World, tracer: Tracer, ego: Scene, name: str, now: int) -> tuple[Array, NDArray[np.uint8]]:
    """The sweep at ``now`` (ns): points (N, 3) in ``world`` where they were met, and their surfaces."""
    starts = np.array(burst_starts(name, world.start_ns, world.scale.duration_s))
    number = int(np.searchsorted(starts, now, side="right")) - 1
    burst, truth = Lidar(world, tracer, ego, name).scan(int(starts[number]), number)
    poses = world.path.at(starts[number] + burst.offset_ns.astype(np.int64)) @ world.rig.rig_from[name]
    return np.einsum("nij,nj->ni", poses[:, :3, :3], burst.points) + poses[:, :3, 3], truth.surface
