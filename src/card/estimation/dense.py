"""From nodes to a pose at every IMU sample: integrated between nodes, and bent to meet them."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.estimation.batch import Nodes
from card.estimation.imu import Imu
from card.estimation.strapdown import integrate
from card.geometry import Trajectory, quaternion_from_matrix

Array = NDArray[np.float64]


def dense_trajectory(nodes: Nodes, imu: Imu, beyond_s: float) -> Trajectory:
    """Poses at all IMU samples from `beyond_s` before the first node to as much after the last.

    Between two nodes the IMU leads from the first; what it misses the second by is spread over the interval
    so that position, velocity and attitude are continuous and each node is met.
    """
    reach = int(beyond_s * 1e9)
    parts = [_beyond(nodes, imu, 0, max(int(imu.t_ns[0]), int(nodes.t_ns[0]) - reach))]
    parts += [_between(nodes, imu, k) for k in range(len(nodes.t_ns) - 1)]
    last = len(nodes.t_ns) - 1
    parts.append(_beyond(nodes, imu, last, min(int(imu.t_ns[-1]), int(nodes.t_ns[-1]) + reach)))
    t_ns, rotation, position = (np.concatenate(values) for values in zip(*parts, strict=True))
    chosen = np.isin(t_ns, imu.t_ns)
    # A node that falls on a sample ends one part and begins the next.
    t_ns, first = np.unique(t_ns[chosen], return_index=True)
    return Trajectory(t_ns, position[chosen][first], quaternion_from_matrix(rotation[chosen][first]))


def _between(nodes: Nodes, imu: Imu, k: int) -> tuple[NDArray[np.int64], Array, Array]:
    samples = imu.between(int(nodes.t_ns[k]), int(nodes.t_ns[k + 1]))
    unbiased = samples.without(nodes.gyro_biases[k], nodes.accel_biases[k])
    path = integrate(unbiased, nodes.poses[k], nodes.velocities[k], nodes.gravity)
    seconds = (path.t_ns - path.t_ns[0]) * 1e-9
    span = seconds[-1]
    s = seconds / span
    turned = Rotation.from_matrix(path.rotation[-1].T @ nodes.poses[k + 1, :3, :3]).as_rotvec()
    smooth = s * s * (3 - 2 * s)
    rotation = path.rotation @ Rotation.from_rotvec(smooth[:, None] * turned).as_matrix()
    # Cubic Hermite: nothing at the start, the whole error of position and velocity at the end.
    missed = nodes.poses[k + 1, :3, 3] - path.position[-1]
    slower = nodes.velocities[k + 1] - path.velocity[-1]
    position = path.position + smooth[:, None] * missed + (s * s * (s - 1) * span)[:, None] * slower
    return path.t_ns, rotation, position


def _beyond(nodes: Nodes, imu: Imu, k: int, until_ns: int) -> tuple[NDArray[np.int64], Array, Array]:
    """Before the first node or after the last one, where only the IMU leads."""
    start, end = sorted((int(nodes.t_ns[k]), until_ns))
    samples = imu.between(start, end).without(nodes.gyro_biases[k], nodes.accel_biases[k])
    if until_ns < nodes.t_ns[k]:
        samples = samples.backwards()
    path = integrate(samples, nodes.poses[k], nodes.velocities[k], nodes.gravity)
    order = np.argsort(path.t_ns)
    return path.t_ns[order], path.rotation[order], path.position[order]
