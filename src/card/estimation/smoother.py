"""Fixed-lag smoothing of the last second: IMU between scan ends, each scan's place in the local map."""

from dataclasses import dataclass
from typing import SupportsFloat, SupportsIndex, SupportsInt

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, G, V, X
from numpy.typing import NDArray

from card.estimation.imu import Imu, ImuNoise
from card.estimation.preintegration import parameters, preintegrate

Array = NDArray[np.float64]
Sigmas = gtsam.noiseModel.Diagonal.Sigmas
#: What fixes the frame: the first pose is where it is.
FIXED = np.full(6, 1e-5)


@dataclass(frozen=True)
class State:
    """The rig at t_ns in the odometry's frame: pose (4, 4), velocity (3,), biases (3,) of gyro and accel.

    gravity : (3,) m/s^2, as it is believed to point now.
    """

    t_ns: int
    pose: Array
    velocity: Array
    gyro_bias: Array
    accel_bias: Array
    gravity: Array

    @property
    def bias(self) -> gtsam.imuBias.ConstantBias:
        """Both biases as gtsam takes them."""
        return gtsam.imuBias.ConstantBias(self.accel_bias, self.gyro_bias)


@dataclass(frozen=True)
class StartSigmas:
    """How well the start is known: velocity m/s, direction of gravity rad."""

    velocity: float
    gravity: float


class Smoother:
    """The window of states; marginalises what is older than the lag."""

    def __init__(self, start: State, sigmas: StartSigmas, noise: ImuNoise, lag_s: float) -> None:
        # The bias walk's information exceeds the rest's by ten orders of magnitude: Cholesky breaks down.
        solver = gtsam.LevenbergMarquardtParams()
        solver.setLinearSolverType("MULTIFRONTAL_QR")
        self._smoother = gtsam.BatchFixedLagSmoother(lag_s, solver)
        self._magnitude = float(np.linalg.norm(start.gravity))
        self._params = parameters(noise, self._magnitude)
        self._t0, self._count = start.t_ns, 0
        self.state = start
        down = gtsam.Unit3(start.gravity / self._magnitude)
        bias_sigmas = np.repeat([noise.accel_bias, noise.gyro_bias], 3)
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        graph.add(gtsam.PriorFactorPose3(X(0), gtsam.Pose3(start.pose), Sigmas(FIXED)))
        graph.add(gtsam.PriorFactorVector(V(0), start.velocity, Sigmas(np.full(3, sigmas.velocity))))
        graph.add(gtsam.PriorFactorConstantBias(B(0), start.bias, Sigmas(bias_sigmas)))
        graph.add(gtsam.PriorFactorUnit3(G(0), down, Sigmas(np.full(2, sigmas.gravity))))
        self._insert(values, start.pose, start.velocity, start.bias)
        values.insert(G(0), down)
        self._smoother.update(graph, values, self._stamps(start.t_ns))

    def add(
        self, imu: Imu, predicted: Array, velocity: Array, place: Array, information: Array | None
    ) -> State:
        """The state at the end of the samples `imu`, which begin at the last state.

        predicted, velocity : where the IMU leads.
        place, information : registered pose and its information (6, 6); None if it is not registered.
        """
        last = self._count
        self._count += 1
        k, bias = self._count, self.state.bias
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        measured = preintegrate(imu, self._params, bias)
        graph.add(
            gtsam.CombinedImuFactorWithGravityDirection(
                X(last), V(last), X(k), V(k), B(last), B(k), G(0), measured, self._magnitude
            )
        )
        if information is not None:
            model = gtsam.noiseModel.Gaussian.Information(information)
            graph.add(gtsam.PriorFactorPose3(X(k), gtsam.Pose3(place), model))
        self._insert(values, predicted, velocity, bias)
        t_ns = int(imu.t_ns[-1])
        self._smoother.update(graph, values, self._stamps(t_ns))
        self.state = self._state(k, t_ns)
        return self.state

    def first(self) -> State:
        """The first state, as all since then tell of it; for a lag that has not run out."""
        return self._state(0, self._t0)

    def _state(self, k: int, t_ns: int) -> State:
        found = self._smoother.calculateEstimate()
        bias = found.atConstantBias(B(k))
        return State(
            t_ns,
            found.atPose3(X(k)).matrix(),
            np.asarray(found.atVector(V(k))),
            np.asarray(bias.gyroscope()),
            np.asarray(bias.accelerometer()),
            self._magnitude * np.asarray(found.atUnit3(G(0)).point3()),
        )

    def _insert(
        self, values: gtsam.Values, pose: Array, velocity: Array, bias: gtsam.imuBias.ConstantBias
    ) -> None:
        values.insert(X(self._count), gtsam.Pose3(pose))
        values.insert(V(self._count), velocity)
        values.insert(B(self._count), bias)

    def _stamps(self, t_ns: int) -> dict[SupportsInt | SupportsIndex, SupportsFloat | SupportsIndex]:
        seconds = (t_ns - self._t0) * 1e-9
        # The direction of gravity never grows old.
        return dict.fromkeys((X(self._count), V(self._count), B(self._count), G(0)), seconds)
