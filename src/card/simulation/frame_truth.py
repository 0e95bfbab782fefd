"""What is true ten times a second: how fast the car is, the road under it, and where everybody else is."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts import write_table
from card.geometry import Trajectory, inverse, quaternion_from_matrix
from card.simulation.footprint import wheel_contacts
from card.simulation.rig import WHEELS
from card.simulation.world import World

Array = NDArray[np.float64]

PERIOD_NS = 100_000_000


def write_frame_truth(world: World, truth: Path) -> None:
    """``frames.parquet`` and ``movers.parquet``, every 0.1 s; the left images' times are among them."""
    count = round(world.scale.duration_s * 10) + 1
    times = world.start_ns + np.arange(count, dtype=np.int64) * PERIOD_NS
    slopes = _road_planes(world, times)
    frames = {
        "t_ns": times,
        "speed_m_s": np.interp(
            (times - world.start_ns) * 1e-9, world.course.t, np.gradient(world.course.s, world.course.t)
        ),
        **{f"normal_{axis}": slopes[:, i] for i, axis in enumerate("xyz")},
        "offset_m": slopes[:, 3],
    }
    write_table(truth / "frames.parquet", frames, "truth_frames")
    bodies = [*(("car", index) for index in world.cars), *(("walker", index) for index in world.walkers)]
    paths = [Trajectory(times, *_parts(world.movers[index].path.at(times))) for _, index in bodies]
    movers = {
        "kind": np.repeat(np.array([kind for kind, _ in bodies], np.str_), count),
        "mover": np.repeat(np.array([index for _, index in bodies], np.int32), count),
        "t_ns": np.tile(times, len(bodies)),
        **{
            column: np.concatenate([path.to_table()[column] for path in paths] or [np.zeros(0)])
            for column in ("x", "y", "z", "qw", "qx", "qy", "qz")
        },
    }
    write_table(truth / "movers.parquet", movers, "truth_movers")


def _road_planes(world: World, times: NDArray[np.int64]) -> Array:
    """Unit normal, upward, and offset (N, 4) in ``rig`` of the plane nearest to the four true contacts."""
    pose = world.path.at(times)
    from_world = inverse(pose)
    path = Trajectory(times, *_parts(pose))
    guess = np.interp((times - world.start_ns) * 1e-9, world.course.t, world.course.s)
    in_rig = np.stack(
        [
            np.einsum("nij,nj->ni", from_world[:, :3, :3], contact) + from_world[:, :3, 3]
            for contact in (
                wheel_contacts(world.road, path, world.rig.wheel_contact_m[wheel], guess) for wheel in WHEELS
            )
        ],
        axis=1,
    )
    design = np.concatenate([in_rig[..., :2], np.ones((*in_rig.shape[:2], 1))], axis=-1)
    a, b, c = (np.linalg.pinv(design) @ in_rig[..., 2:])[..., 0].T
    plane = np.stack([-a, -b, np.ones_like(a), -c], axis=-1)
    return np.asarray(plane / np.linalg.norm(plane[:, :3], axis=1, keepdims=True))


def _parts(pose: Array) -> tuple[Array, Array]:
    return pose[:, :3, 3], quaternion_from_matrix(pose[:, :3, :3])
