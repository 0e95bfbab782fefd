"""What a session's drive determines, as one vector of parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.plane_kernels import CHANNELS, CORRECTIONS
from card.estimation.batch import Nodes
from card.estimation.dense import dense_trajectory
from card.estimation.imu import Imu
from card.geometry import Trajectory
from card.recording.paths import LIDARS

Array = NDArray[np.float64]
CHANNEL_FIELDS = ("channel_range_offset_m", "channel_elevation_offset_rad", "channel_azimuth_offset_rad")


@dataclass(frozen=True)
class Columns:
    """Where each kind of parameter lies in the vector of a state with so many knots.

    A pose is disturbed on its right, rotation first: R exp(phi), t + R rho.
    """

    knots: int

    @property
    def mountings(self) -> int:
        """First of rig_from_lidar, 6 a LiDAR; before them are the poses of the knots."""
        return 6 * self.knots

    @property
    def corrections(self) -> int:
        """First of the LiDARs' corrections."""
        return self.mountings + 12

    @property
    def lidar_size(self) -> int:
        """Parameters that returns depend on; the rest is the IMU's."""
        return self.corrections + 2 * CORRECTIONS

    @property
    def velocities(self) -> int:
        """First of the velocities, 3 a knot."""
        return self.lidar_size

    @property
    def biases(self) -> int:
        """First of the biases, gyro (3) and accelerometer (3) a knot."""
        return self.velocities + 3 * self.knots

    @property
    def triangles(self) -> int:
        """First of the upper triangles of gyro (6) and accelerometer (6)."""
        return self.biases + 6 * self.knots

    @property
    def size(self) -> int:
        """Number of parameters."""
        return self.triangles + 2 * len(UPPER)


@dataclass(frozen=True)
class State:
    """Knots at t_ns (K,), in a world with z up: poses (K, 4, 4) of the rig, velocities, biases (K, 3).

    mounted : (2, 4, 4) rig_from_lidar.  corrections : (2, CORRECTIONS) by LiDAR: common range offset, then
    range, elevation and azimuth offset a channel.  gyro_matrix, accel_matrix : (3, 3), upper triangular; rate
    and force are matrix @ measured - bias.
    """

    t_ns: NDArray[np.int64]
    poses: Array
    velocities: Array
    gyro_biases: Array
    accel_biases: Array
    mounted: Array
    corrections: Array
    gyro_matrix: Array = field(default_factory=lambda: np.eye(3))
    accel_matrix: Array = field(default_factory=lambda: np.eye(3))

    @property
    def columns(self) -> Columns:
        """Where its parameters lie."""
        return Columns(len(self.t_ns))

    def moved(self, step: Array) -> "State":
        """The state after a step (P,) of its parameters."""
        at, count = self.columns, len(self.t_ns)
        biases = step[at.biases : at.triangles].reshape(count, 6)
        triangles = step[at.triangles :].reshape(2, len(UPPER))
        gyro, accel = self.gyro_matrix.copy(), self.accel_matrix.copy()
        for u, entry in enumerate(UPPER):
            gyro[entry] += triangles[0, u]
            accel[entry] += triangles[1, u]
        return replace(
            self,
            poses=_disturbed(self.poses, step[: at.mountings].reshape(-1, 6)),
            mounted=_disturbed(self.mounted, step[at.mountings : at.corrections].reshape(2, 6)),
            corrections=self.corrections + step[at.corrections : at.lidar_size].reshape(2, CORRECTIONS),
            velocities=self.velocities + step[at.velocities : at.biases].reshape(count, 3),
            gyro_biases=self.gyro_biases + biases[:, :3],
            accel_biases=self.accel_biases + biases[:, 3:],
            gyro_matrix=gyro,
            accel_matrix=accel,
        )

    def trajectory(self, imu: Imu, gravity_m_s2: float) -> Trajectory:
        """The rig at the IMU's times from the first knot to the last: integrated, bent to meet the knots."""
        true = imu.corrected(self.gyro_matrix, self.accel_matrix)
        gravity = np.array([0.0, 0.0, -gravity_m_s2])
        nodes = Nodes(self.t_ns, self.poses, self.velocities, self.gyro_biases, self.accel_biases, gravity)
        return dense_trajectory(nodes, true, 0.0)

    def documents(self) -> dict[str, dict[str, Any]]:
        """The corrections as ``lidar_corrections`` of a calibration."""
        return {name: corrections_document(row) for name, row in zip(LIDARS, self.corrections, strict=True)}


def corrections_document(row: Array) -> dict[str, Any]:
    """Corrections (CORRECTIONS,) of a LiDAR, or their sigmas, as a document."""
    channels = row[1:].reshape(3, CHANNELS)
    return {"range_offset_m": float(row[0])} | {
        name: [float(value) for value in values]
        for name, values in zip(CHANNEL_FIELDS, channels, strict=True)
    }


def corrections_row(document: Mapping[str, Any]) -> Array:
    """The reverse of `corrections_document`."""
    return np.concatenate([[document["range_offset_m"]], *(document[name] for name in CHANNEL_FIELDS)])


def _disturbed(poses: Array, steps: Array) -> Array:
    """Poses (N, 4, 4) moved by steps (N, 6)."""
    result = poses.copy()
    result[:, :3, 3] += np.einsum("nij,nj->ni", poses[:, :3, :3], steps[:, 3:])
    result[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(steps[:, :3]).as_matrix()
    return result
