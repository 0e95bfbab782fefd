"""Who else is on the road: walkers and cars, and the ways they go."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, quaternion_from_matrix, transform
from card.simulation.bodies import car, leg, walker
from card.simulation.drives import Drive
from card.simulation.faces_and_plates import face_texture, plate_texture
from card.simulation.mesh import Mesh
from card.simulation.raycast import Mover
from card.simulation.road import Road
from card.simulation.vehicle import Course

Array = NDArray[np.float64]

_PATH_HZ = 25
_WALK_M_S = 1.3
_STRIDE_HZ = 0.9
_HIP_M = (0.10, 0.92)
_COLOURS = np.array(
    [(0.5, 0.5, 0.52), (0.03, 0.03, 0.035), (0.45, 0.05, 0.05), (0.05, 0.1, 0.35), (0.7, 0.7, 0.68)]
)


@dataclass(frozen=True)
class Thing:
    """What can be told apart in an image, by ``kind``; faces and plates have a texture."""

    kind: str
    texture: NDArray[np.uint8] | None = None


@dataclass
class Traffic:
    """Builds movers and parked cars while it keeps the list of things that carry labels.

    things : grows with each face and plate.  movers, parked : what was built.
    cars : indices of the movers that are cars, their lamps on.
    """

    drive: Drive
    road: Road
    course: Course
    start_ns: int
    rng: np.random.Generator
    things: list[Thing]
    movers: list[Mover] = field(default_factory=list)
    parked: list[Mesh] = field(default_factory=list)
    cars: list[int] = field(default_factory=list)

    def populate(self, camera_start_s: float, duration_s: float) -> None:
        """Put everyone on the road of a drive of ``duration_s`` with cameras from ``camera_start_s``."""
        drive, begin = self.drive, camera_start_s
        edge = drive.section.half_width
        if drive.crossing_s is not None:
            stops = any(speed == 0 for _, speed in drive.speeds)
            # A car that does not stop must find them gone when it gets there.
            ahead, early = (3.5, 0.0) if stops else (13.0, 1.4)
            look = begin + drive.crossing_s
            for index, late in enumerate((-1.0, 0.4, 1.6)):
                where = self.course.at(look) + ahead + 0.6 * index
                self.cross(where, look + late - early, -1 if index == 1 else 1)
        if drive.walker_spacing:
            first = self.course.at(begin + 1.0) + 5.5
            for k in range(-2, 12):
                side = 1 if k % 3 else -1
                t = self._when(first + k * drive.walker_spacing, duration_s)
                self.stroll(first + k * drive.walker_spacing, side * (edge + 0.9), t, towards=k % 4 != 3)
        if drive.oncoming_s:
            for t in np.arange(begin % drive.oncoming_s + 1.5, duration_s + 6, drive.oncoming_s):
                self.oncoming(float(t))
        if drive.leader:
            self.follow(2.4)
            self.follow(-2.2)
        if drive.parked_spacing:
            span = self.course.at(duration_s) - self.course.at(0)
            for s in np.arange(4.0, min(span + 60, 700), drive.parked_spacing):
                self.park(self.course.at(0) + s + self.rng.uniform(-3, 3))

    def cross(self, s: float, t: float, direction: int) -> None:
        """A walker crossing at ``s`` to the right (1) or left (-1), before the car at ``t`` (s)."""
        lane = self.drive.section.lane

        def way(time: Array) -> tuple[Array, Array, Array]:
            d = lane + direction * _WALK_M_S * (time - t)
            return np.full_like(time, s), d, np.full_like(time, -direction * np.pi / 2)

        self._walk(way, head_turn=-direction * np.radians(80))

    def stroll(self, s: float, d: float, t: float, *, towards: bool) -> None:
        """A walker along the road, at (s, d) at time ``t`` (s), walking towards the car or away."""
        sign = -1.0 if towards else 1.0

        def way(time: Array) -> tuple[Array, Array, Array]:
            turn = np.pi if towards else 0.0
            return s + sign * _WALK_M_S * (time - t), np.full_like(time, d), np.full_like(time, turn)

        self._walk(way, head_turn=np.sign(d) * -np.radians(12) * (1 if towards else 0))

    def oncoming(self, t: float) -> None:
        """A car in the other lane that meets ours at time ``t`` (s)."""
        speed, meet = self.rng.uniform(6, 9), self.course.at(t)
        lane = -max(self.drive.section.lane, 1.1)
        self._drive_along(
            lambda time: (meet - speed * (time - t), np.full_like(time, lane), np.pi + 0 * time)
        )

    def follow(self, headway_s: float) -> None:
        """A car in our lane, ``headway_s`` ahead of us (behind if negative), at our own speeds."""
        lane, course = self.drive.section.lane, self.course
        gap = 6.0 * np.sign(headway_s)
        last = course.t[-1]

        def way(time: Array) -> tuple[Array, Array, Array]:
            s = np.interp(time + headway_s, course.t, course.s) + gap
            beyond = np.maximum(time + headway_s - last, 0) * 6.0
            before = np.minimum(time + headway_s - course.t[0], 0) * 6.0
            return s + beyond + before, np.full_like(time, lane), 0 * time

        self._drive_along(way)

    def park(self, s: float) -> None:
        """A parked car, half on the sidewalk, on the left more often than on the right."""
        side = -1.0 if self.rng.random() < 0.75 else 1.0
        pose = self.road.pose(s, side * (self.drive.section.half_width + 0.75), 0.0 if side > 0 else np.pi)
        self.parked.append(self._car(lit=False).moved(pose))

    def _drive_along(self, way: Callable[[Array], tuple[Array, Array, Array]]) -> None:
        self.cars.append(len(self.movers))
        self.movers.append(Mover(self._car(lit=True), self._path(way)))

    def _walk(self, way: Callable[[Array], tuple[Array, Array, Array]], head_turn: float) -> None:
        colours = _COLOURS[self.rng.integers(0, len(_COLOURS), 2)] * self.rng.uniform(0.7, 1.2, (2, 1))
        height = self.rng.uniform(1.62, 1.85)
        self.things.append(Thing("face", face_texture(len(self.things))))
        face = len(self.things) - 1
        self.movers.append(Mover(walker(colours, face, head_turn, height), self._path(way)))
        phase = self.rng.uniform(0, 2 * np.pi)
        for side in (-1.0, 1.0):
            path = self._path(
                way, hip=(side * _HIP_M[0], _HIP_M[1] * height / 1.75), phase=phase + side * np.pi / 2
            )
            self.movers.append(Mover(leg(colours[1], height), path))

    def _path(
        self,
        way: Callable[[Array], tuple[Array, Array, Array]],
        hip: tuple[float, float] | None = None,
        phase: float = 0.0,
    ) -> Trajectory:
        t = np.arange(self.course.t[0], self.course.t[-1] + 1 / _PATH_HZ, 1 / _PATH_HZ)
        s, d, turn = way(t)
        if not self.road.line.closed:
            # Beyond the road's ends, movers wait out of sight.
            s = np.clip(s, self.road.line.start + 3, self.road.line.start + self.road.line.length - 3)
        pose = self.road.pose(s, d, turn)
        if hip is not None:
            swing = 0.45 * np.sin(2 * np.pi * _STRIDE_HZ * t + phase)
            zero = np.zeros_like(t)
            quaternion = np.stack([np.cos(swing / 2), np.sin(swing / 2), zero, zero], axis=-1)
            pose = pose @ transform((hip[0], 0.0, hip[1]), quaternion)
        t_ns = self.start_ns + np.round(t * 1e9).astype(np.int64)
        return Trajectory(t_ns, pose[:, :3, 3], quaternion_from_matrix(pose[:, :3, :3]))

    def _car(self, *, lit: bool) -> Mesh:
        colour = _COLOURS[self.rng.integers(0, len(_COLOURS))] * self.rng.uniform(0.8, 1.2)
        plate = plate_texture(self.drive.country, self.rng)
        self.things += [Thing("plate", plate), Thing("plate", plate)]
        return car(colour, (len(self.things) - 2, len(self.things) - 1), lit=lit)

    def _when(self, s: float, duration_s: float) -> float:
        """When the car is about 5 m before arc length ``s``."""
        return float(np.clip(np.interp(s - 5.0, self.course.s, self.course.t), 0, duration_s))
