"""Everything a drive's sensors meet: road, houses, traffic, and the car's own way through it."""

import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, inverse, quaternion_from_matrix, transform
from card.simulation import scenery
from card.simulation.calibrations import session_rig
from card.simulation.centreline import CentreLine, circuit, winding
from card.simulation.drives import Drive, drive_named
from card.simulation.mesh import Mesh, join
from card.simulation.raycast import Mover
from card.simulation.rig import Rig
from card.simulation.road import Road, hills
from card.simulation.road_mesh import land_mesh, road_mesh
from card.simulation.road_plan import plan
from card.simulation.scales import Scale, scale_named
from card.simulation.spectrum import roughness
from card.simulation.traffic import Thing, Traffic
from card.simulation.vehicle import Course, Lane, Load, course, ride

Array = NDArray[np.float64]

_BEHIND_M, _AHEAD_M = 60.0, 130.0


@dataclass(frozen=True)
class World:
    """One drive before any sensor has looked at it.

    path : true ``world_from_rig`` at 1 kHz, beginning before and ending after the recording.
    static : the mesh of all that stands still.  movers : all that moves.
    things : what labels are drawn around; the first ones are the road's irregularities.
    sun : (3,) unit vector towards it, or at night towards the moon.
    lamps : (L, 3) where street lamps shine from; they are on at night.
    cars : indices of the movers that are cars, their headlights on (`bodies.HEADLIGHTS_M`).
    walkers : indices of the movers that are walkers' trunks, each followed by its four limbs.
    """

    name: str
    drive: Drive
    scale: Scale
    seed: int
    rig: Rig
    start_ns: int
    road: Road
    course: Course
    path: Trajectory
    static: Mesh
    movers: list[Mover]
    things: list[Thing]
    sun: Array
    lamps: Array
    cars: tuple[int, ...]
    walkers: tuple[int, ...]

    def rng(self, purpose: str) -> np.random.Generator:
        """A random stream of its own for each purpose."""
        return _rng(self.seed, self.name, purpose)


def build_world(name: str, scale: str, seed: int) -> World:
    """The world of one demo drive at one scale; any seed makes a new one."""
    return world_of(name, drive_named(name), scale_named(scale), seed)


def world_of(name: str, drive: Drive, size: Scale, seed: int) -> World:
    """The world of any drive, at a scale that may have a duration of its own."""
    start_ns = drive.start_ns
    size = size.cut(drive.lasts_s)
    begin = size.camera_start_s
    where = course([(t + begin, v) for t, v in drive.speeds], 0.0, size.duration_s)

    rng = _rng(seed, name, "road")
    line = _line(drive, where, rng)
    road = Road(
        line,
        drive.section,
        hills(rng),
        roughness(drive.road_class, rng, line.length if line.closed else None),
        plan(drive, line, where.at(begin), rng),
        np.eye(4),
    )
    lane = Lane(drive.section.lane, 0.12, 65.0 if not line.closed else line.length / 3, rng.uniform(0, 6))
    loads = tuple(Load(t + begin, *load) for t, *load in drive.loads)
    path = ride(road, lane, where, start_ns, loads)
    world_from_map = _level(inverse(path.at(start_ns)))
    road = road.placed(world_from_map)
    path = Trajectory(path.t_ns, *_parts(world_from_map @ path.at(path.t_ns)))

    standing, lamps, taken = _scenery(drive, road, _rng(seed, name, "scenery"))
    things = [Thing(thing.kind) for thing in road.irregularities]
    traffic = Traffic(drive, road, where, start_ns, _rng(seed, name, "traffic"), taken, things)
    traffic.populate(begin, size.duration_s)
    static = join([*_ground(road, where), *standing, *traffic.parked])
    light = _rng(seed, name, "light")
    azimuth, elevation = light.uniform(0, 2 * np.pi), np.radians(light.uniform(35, 60))
    sun = np.array(
        [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
    )
    rig = session_rig(drive.session, seed, size.name)
    return World(
        name,
        drive,
        size,
        seed,
        rig,
        start_ns,
        road,
        where,
        path,
        static,
        traffic.movers,
        things,
        sun,
        np.array(lamps).reshape(-1, 3),
        tuple(traffic.cars),
        tuple(traffic.walkers),
    )


def _line(drive: Drive, where: Course, rng: np.random.Generator) -> CentreLine:
    if drive.circuit is not None:
        return circuit(*drive.circuit)
    return winding(float(where.s[-1]) + _BEHIND_M + _AHEAD_M, -_BEHIND_M, drive.bend, rng)


def _ground(road: Road, where: Course) -> list[Mesh]:
    line = road.line
    whole = (line.start, line.start + line.length)
    fine = whole
    if not line.closed:
        whole = (whole[0] + 1, whole[1] - 1)
        fine = (where.at(0.0) - 15, float(where.s[-1]) + 20)
    s = np.arange(*whole, 5.0)
    return [road_mesh(road, fine, whole), land_mesh(road, road.xyz(s, 0 * s)[:, :2])]


def _scenery(
    drive: Drive, road: Road, rng: np.random.Generator
) -> tuple[list[Mesh], list[Array], list[scenery.Place]]:
    """Meshes of what stands beside the road, where its lamps shine from, and what stands at the kerb."""
    span = (road.line.start + 2, road.line.start + road.line.length - 2)
    found: list[Mesh] = []
    lamps: list[Array] = []
    taken: list[scenery.Place] = []
    if drive.house_depth:
        found += scenery.houses(road, span, drive.house_depth, rng)
    if drive.section.kerb:
        taken += scenery.pole_places(road, span, rng)
        masts, lamps = scenery.poles(road, taken)
        found += masts
    if drive.tree_spacing:
        street = bool(drive.house_depth)
        places = scenery.tree_places(road, span, drive.tree_spacing, rng, street=street)
        places = [p for p in places if all(np.hypot(p[0] - q[0], p[1] - q[1]) > 2.5 for q in taken)]
        found += scenery.trees(road, places, rng, street=street)
        taken += places
    return found, lamps, taken


def _level(rig_from_map: Array) -> Array:
    """``world_from_map``: shift and turn about z that put the first rig pose at the origin, ahead on +y."""
    map_from_rig = inverse(rig_from_map)
    forward = map_from_rig[:2, 1]
    yaw = np.arctan2(-forward[0], forward[1])
    turn = transform((0, 0, 0), (np.cos(yaw / 2), 0, 0, -np.sin(yaw / 2)))
    return turn @ transform(-map_from_rig[:3, 3])


def _parts(pose: Array) -> tuple[Array, Array]:
    return pose[:, :3, 3], quaternion_from_matrix(pose[:, :3, :3])


def _rng(seed: int, name: str, purpose: str) -> np.random.Generator:
    return np.random.default_rng([seed, zlib.crc32(f"{name}/{purpose}".encode())])
