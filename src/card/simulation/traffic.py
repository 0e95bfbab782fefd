"""Who else is on the road: walkers and cars, and the ways they go."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, quaternion_from_matrix, transform
from card.simulation.bodies import (
    CAR_LENGTH_M,
    CAR_TRACK_M,
    CAR_WHEELBASE_M,
    HIP_M,
    SHOULDER_M,
    arm,
    car,
    leg,
    walker,
)
from card.simulation.car_following import Barrier, flow
from card.simulation.drives import Drive
from card.simulation.faces_and_plates import face_texture, plate_texture
from card.simulation.mesh import Mesh
from card.simulation.raycast import Mover
from card.simulation.road import Road
from card.simulation.vehicle import Course
from card.simulation.walking import ARM_SWING, LEG_SWING, Way, aside, crossing, strolling, swing

Array = NDArray[np.float64]

_PATH_HZ = 25
_COLOURS = np.array(
    [(0.5, 0.5, 0.52), (0.03, 0.03, 0.035), (0.45, 0.05, 0.05), (0.05, 0.1, 0.35), (0.7, 0.7, 0.68)]
)
#: From our rig's origin to our rear bumper.
_OWN_REAR_M = 2.95
#: How far beyond the kerb cars park (their middle), and walkers walk: by direction, past cars, and to cross.
_PARKED_M, _TOWARDS_M, _AWAY_M, _BESIDE_PARKED_M, _CROSSED_M = 0.6, 0.9, 1.45, 1.85, 1.8
_MOST_WALKERS = 40
#: Nobody parks inside a sharper bend, 1/m: the corners would block the sidewalk.
_SHARPEST_PARKING = 1 / 30
#: What is beyond an open road's ends waits below the ground.
_OUT_OF_SIGHT_M = 30.0


@dataclass(frozen=True)
class Thing:
    """What can be told apart in an image, by ``kind``; faces and plates have a texture."""

    kind: str
    texture: NDArray[np.uint8] | None = None


@dataclass
class Traffic:
    """Builds movers and parked cars while it keeps the list of things that carry labels.

    taken : (s, d) of lamps and trees, where nobody parks.
    things : grows with each face and plate.  movers, parked : what was built.
    cars, walkers : indices of the movers that are cars, their lamps on, and of walkers' trunks.
    """

    drive: Drive
    road: Road
    course: Course
    start_ns: int
    rng: np.random.Generator
    taken: list[tuple[float, float]]
    things: list[Thing]
    movers: list[Mover] = field(default_factory=list)
    parked: list[Mesh] = field(default_factory=list)
    cars: list[int] = field(default_factory=list)
    walkers: list[int] = field(default_factory=list)
    _parked_at: list[tuple[float, float]] = field(default_factory=list)
    _barrier: Barrier | None = None
    _kept_clear: float | None = None

    def __post_init__(self) -> None:
        self._time = np.arange(self.course.t[0], self.course.t[-1] + 1 / _PATH_HZ, 1 / _PATH_HZ)

    def populate(self, camera_start_s: float, duration_s: float) -> None:
        """Put everyone on the road of a drive of ``duration_s`` with cameras from ``camera_start_s``."""
        drive, begin = self.drive, camera_start_s
        if drive.crossing_s is not None:
            self._cross_all(begin + drive.crossing_s)
        if drive.parked_spacing:
            span = self.course.at(duration_s) - self.course.at(0)
            longest = self.road.line.length - drive.parked_spacing if self.road.line.closed else np.inf
            for s in np.arange(4.0, min(span + 60, 700, longest), drive.parked_spacing):
                self.park(self.course.at(0) + s + self.rng.uniform(-3, 3))
        if drive.walker_spacing:
            first = self.course.at(begin + 1.0) + 5.5
            count = int((self.course.at(duration_s) - first) / drive.walker_spacing) + 2
            for k in range(-2, min(max(count, 12), _MOST_WALKERS)):
                s = first + k * drive.walker_spacing
                self.stroll(s, 1.0 if k % 3 else -1.0, self._when(s, duration_s), towards=k % 4 != 3)
        if drive.oncoming_s:
            self.oncoming(begin % drive.oncoming_s + 1.5, duration_s)
        if drive.leader:
            self.lead(4.0)
        if drive.follower:
            self.follow()

    def cross(self, s: float, t: float, direction: int) -> None:
        """A walker crossing at ``s`` to the right (1) or left (-1), before the car at ``t`` (s)."""
        section = self.drive.section
        side, along = section.half_width + _CROSSED_M, 1 if self.rng.random() < 0.5 else -1
        way = crossing(self._time, s, section.lane, side, t, direction, along)
        self._walk(way, head_turn=-direction * np.radians(80))

    def stroll(self, s: float, side: float, t: float, *, towards: bool) -> None:
        """A walker beside the road, at ``s`` at time ``t`` (s), walking towards the car or away."""
        edge = self.drive.section.half_width
        usual, far = edge + (_TOWARDS_M if towards else _AWAY_M), edge + _BESIDE_PARKED_M
        cars = [at for at, d in self._parked_at if d * side > 0]
        if self.road.line.closed:
            cars = [at + turn * self.road.line.length for at in cars for turn in (-1, 0, 1)]
        way = strolling(
            self._time, s, t, towards, lambda at: side * aside(at, cars, CAR_LENGTH_M / 2, usual, far)
        )
        self._walk(way, head_turn=-side * np.radians(12) * (1 if towards else 0))

    def oncoming(self, first_s: float, duration_s: float) -> None:
        """Cars in the other lane, the first one met at ``first_s``, and further ones every so often."""
        speed, line = self.rng.uniform(6.5, 9), self.road.line
        meetings = np.arange(first_s, duration_s + 6, self.drive.oncoming_s)
        met = np.array([self.course.at(float(t)) for t in meetings])
        start, ring = -(met + speed * (meetings - self._time[0])), None
        if line.closed:
            own = float(np.ptp(self.course.s)) / float(np.ptp(self.course.t))
            count = max(1, round(line.length / ((own + speed) * self.drive.oncoming_s)))
            start, ring = start[0] - line.length / count * np.arange(count), line.length
        place = flow(
            self._time, start, speed, speed, CAR_LENGTH_M, ring=ring, barrier=self._barrier
        )  # it counts their way, against ours
        lane = -max(self.drive.section.lane, 1.1)
        for column in place.T:
            self._drive(-column, lane, backwards=True)

    def lead(self, headway_s: float) -> None:
        """A car in our lane ``headway_s`` ahead of us, at our own speeds."""
        course, time = self.course, self._time + headway_s
        beyond = np.maximum(time - course.t[-1], 0) * 6.0
        self._drive(np.interp(time, course.t, course.s) + beyond + 6.0, self.drive.section.lane)

    def follow(self) -> None:
        """A car behind us that keeps its distance."""
        rear = np.interp(self._time, self.course.t, self.course.s) - _OWN_REAR_M
        speed = float(rear[1] - rear[0]) * _PATH_HZ
        start = np.array([rear[0] - CAR_LENGTH_M / 2 - 4.0 - 1.2 * speed])
        place = flow(self._time, start, speed, 14.0, CAR_LENGTH_M, ahead=rear)
        self._drive(place[:, 0], self.drive.section.lane)

    def park(self, s: float) -> None:
        """A parked car, half on the sidewalk, on the left more often than on the right."""
        side = -1.0 if self.rng.random() < 0.75 else 1.0
        d = side * (self.drive.section.half_width + _PARKED_M)
        lamps = any(self._apart(s, at) < CAR_LENGTH_M / 2 + 0.5 and d * where > 0 for at, where in self.taken)
        sharp = -side * float(self.road.line.curvature(s)) > _SHARPEST_PARKING
        if lamps or sharp or (self._kept_clear is not None and self._apart(s, self._kept_clear) < 6.0):
            return
        self._parked_at.append((s, d))
        pose = self._on_wheels(np.array([s]), np.array([d]), backwards=side < 0)[0]
        self.parked.append(self._car(lit=False).moved(pose))

    def _cross_all(self, look: float) -> None:
        """Three walkers before the car at ``look`` (s), the middle one the other way; oncoming cars wait."""
        stops = any(speed == 0 for _, speed in self.drive.speeds)
        # A car that does not stop must find them gone when it gets there.
        ahead, early = (3.5, 0.0) if stops else (13.0, 0.5)
        times = [look + late - early for late in (-1.0, 0.3, 1.0)]
        for index, t in enumerate(times):
            self.cross(self.course.at(look) + ahead + 0.6 * index, t, -1 if index == 1 else 1)
        self._kept_clear = self.course.at(look) + ahead + 0.6
        self._barrier = Barrier(-(self._kept_clear + 2.5), times[0] - 7.0, times[-1] + 4.0)

    def _apart(self, s: float, other: float) -> float:
        gap = abs(s - other)
        if self.road.line.closed:
            gap %= self.road.line.length
            gap = min(gap, self.road.line.length - gap)
        return gap

    def _drive(self, s: Array, d: float, *, backwards: bool = False) -> None:
        """A car over arc lengths (N,), its wheels on the road."""
        pose = self._on_wheels(s, np.full_like(s, d), backwards=backwards)
        self.cars.append(len(self.movers))
        self.movers.append(Mover(self._car(lit=True), self._path(pose)))

    def _on_wheels(self, s: Array, d: Array, *, backwards: bool) -> Array:
        """``world_from_body`` (N, 4, 4) of a car on the plane nearest to the ground under its four wheels."""
        sign = -1.0 if backwards else 1.0
        pose = self._pose(s, d, np.full_like(s, np.pi if backwards else 0.0))
        kept = self._on_road(s)
        ground = np.array(
            [
                [
                    self.road.xyz(kept + sign * y, d + sign * x)[:, 2]
                    for x in (-CAR_TRACK_M / 2, CAR_TRACK_M / 2)
                ]
                for y in (CAR_WHEELBASE_M / 2, -CAR_WHEELBASE_M / 2)
            ]
        )
        pose[:, 2, 3] += ground.mean(axis=(0, 1)) - self.road.xyz(kept, d)[:, 2]
        (front, rear), (left, right) = ground.mean(axis=1), ground.mean(axis=0)
        rise, roll = np.arctan2(front - rear, CAR_WHEELBASE_M), np.arctan2(left - right, CAR_TRACK_M)
        return pose @ _turn(rise, 0) @ _turn(roll, 1)

    def _walk(self, way: Way, head_turn: float) -> None:
        colours = _COLOURS[self.rng.integers(0, len(_COLOURS), 2)] * self.rng.uniform(0.7, 1.2, (2, 1))
        height, phase = self.rng.uniform(1.62, 1.85), self.rng.uniform(0, 2 * np.pi)
        self.things.append(Thing("face", face_texture(len(self.things))))
        trunk = self._pose(way.s, way.d, way.turn)
        self.walkers.append(len(self.movers))
        self.movers.append(Mover(walker(colours, len(self.things) - 1, head_turn, height), self._path(trunk)))
        for side in (-1.0, 1.0):
            # An arm swings with the other side's leg.
            for limb, joint, widest, turn in (
                (leg(colours[1], height), HIP_M, LEG_SWING, side),
                (arm(colours[0], height, side), SHOULDER_M, ARM_SWING, -side),
            ):
                angle = swing(way, 1 / _PATH_HZ, widest, phase + turn * np.pi / 2)
                hung = transform(np.array([side * joint[0], 0.0, joint[1]]) * height / 1.75)
                self.movers.append(Mover(limb, self._path(trunk @ hung @ _turn(angle, 0))))

    def _pose(self, s: Array, d: Array, turn: Array) -> Array:
        """``world_from_body`` (N, 4, 4) on the road; what is beyond its ends waits out of sight."""
        kept = self._on_road(s)
        pose = self.road.pose(kept, d, turn)
        pose[:, 2, 3] -= np.where(kept == s, 0.0, _OUT_OF_SIGHT_M)
        return pose

    def _on_road(self, s: Array) -> Array:
        """Arc lengths (N,), those beyond an open road's ends at its ends."""
        line = self.road.line
        return s if line.closed else np.clip(s, line.start + 5, line.start + line.length - 5)

    def _path(self, pose: Array) -> Trajectory:
        t_ns = self.start_ns + np.round(self._time * 1e9).astype(np.int64)
        return Trajectory(t_ns, pose[:, :3, 3], quaternion_from_matrix(pose[:, :3, :3]))

    def _car(self, *, lit: bool) -> Mesh:
        colour = _COLOURS[self.rng.integers(0, len(_COLOURS))] * self.rng.uniform(0.8, 1.2)
        plate = plate_texture(self.drive.country, self.rng)
        self.things += [Thing("plate", plate), Thing("plate", plate)]
        return car(colour, (len(self.things) - 2, len(self.things) - 1), lit=lit)

    def _when(self, s: float, duration_s: float) -> float:
        """When the car is about 5 m before arc length ``s``."""
        return float(np.clip(np.interp(s - 5.0, self.course.s, self.course.t), 0, duration_s))


def _turn(angle: Array, axis: int) -> Array:
    """Turns (N, 4, 4) by ``angle`` (N,) rad about x (axis 0: the front rises) or y (1: the left rises)."""
    quaternion = np.zeros((len(angle), 4))
    quaternion[:, 0], quaternion[:, 1 + axis] = np.cos(angle / 2), np.sin(angle / 2)
    return transform(np.zeros((len(angle), 3)), quaternion)
