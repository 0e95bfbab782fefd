"""A whole drive in one factor graph: all IMU, relative poses, gravity and biases that wander (gtsam)."""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, G, V, X
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from card.estimation.imu import Imu, ImuNoise
from card.estimation.preintegration import parameters, preintegrate
from card.geometry import quaternion_from_matrix

Array = NDArray[np.float64]
Sigmas = gtsam.noiseModel.Diagonal.Sigmas
#: The first pose only fixes the frame; velocity (m/s) and direction of gravity (rad) at the start are free.
FIXED, FREE_VELOCITY, FREE_GRAVITY = np.full(6, 1e-5), np.full(3, 30.0), np.full(2, 0.5)
MAX_ITERATIONS = 20


@dataclass(frozen=True)
class Between:
    """A measured relative pose: first_from_second (4, 4) of two nodes, and its information (6, 6).

    The information is in the second node's axes, rotation (rad) before translation (m).
    """

    first: int
    second: int
    first_from_second: Array
    information: Array


@dataclass(frozen=True)
class Nodes:
    """States in one frame at t_ns (N,): poses (N, 4, 4), velocities, biases (N, 3); gravity (3,) m/s^2."""

    t_ns: NDArray[np.int64]
    poses: Array
    velocities: Array
    gyro_biases: Array
    accel_biases: Array
    gravity: Array


@dataclass(frozen=True)
class Uncertainty:
    """One sigma: of the biases (M, 3) at some nodes (M,), and of the direction of gravity (2,), rad."""

    nodes: NDArray[np.intp]
    gyro_biases: Array
    accel_biases: Array
    gravity: Array


class Batch:
    """The graph of one drive: IMU factors are built once, relative poses are given anew at each solution."""

    def __init__(self, imu: Imu, nodes: Nodes, noise: ImuNoise) -> None:
        """nodes : the first guess, at whose biases the IMU is linearised."""
        self._noise = noise
        self._magnitude = float(np.linalg.norm(nodes.gravity))
        params = parameters(noise, self._magnitude)
        self._imu = gtsam.NonlinearFactorGraph()
        for k in range(len(nodes.t_ns) - 1):
            samples = imu.between(int(nodes.t_ns[k]), int(nodes.t_ns[k + 1]))
            measured = preintegrate(samples, params, _bias(nodes, k))
            keys = X(k), V(k), X(k + 1), V(k + 1), B(k), B(k + 1), G(0)
            self._imu.add(gtsam.CombinedImuFactorWithGravityDirection(*keys, measured, self._magnitude))
        self._graph, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def solve(self, start: Nodes, relative: Sequence[Between]) -> Nodes:
        """The least-squares solution (Levenberg-Marquardt) from a start."""
        self._graph = self._priors(start)
        self._graph.push_back(self._imu)
        for between in relative:
            self._graph.add(_factor(between))
        values = _values(start, self._magnitude)
        params = gtsam.LevenbergMarquardtParams()
        # The bias walk's information exceeds the rest's by ten orders of magnitude: Cholesky breaks down.
        params.setLinearSolverType("MULTIFRONTAL_QR")
        params.setMaxIterations(MAX_ITERATIONS)
        params.setRelativeErrorTol(1e-6)
        params.setOrdering(gtsam.Ordering.ColamdConstrainedLastNonlinearFactorGraph(self._graph, [G(0)]))
        self._values = gtsam.LevenbergMarquardtOptimizer(self._graph, values, params).optimize()
        return _nodes(self._values, start.t_ns, self._magnitude)

    def imu_residuals(self) -> Array:
        """Normalised residual (N-1,) of each IMU factor at the last solution: root of chi^2 / 15."""
        chi2 = [2 * self._imu.at(k).error(self._values) for k in range(self._imu.size())]
        return np.sqrt(np.array(chi2) / 15)

    def uncertainty(self, nodes: Sequence[int]) -> Uncertainty:
        """Standard deviations at the last solution.

        gtsam's own marginals break down where units lie far apart: here the normal equations are scaled.
        """
        linear = self._graph.linearize(self._values)
        rows, columns, entries = linear.sparseJacobian_()
        # One-based; the last column is the right-hand side.
        size = self._values.dim()
        inside = columns <= size
        shape = (int(rows.max()), size)
        place = rows[inside].astype(np.int64) - 1, columns[inside].astype(np.int64) - 1
        jacobian = sparse.csc_matrix((entries[inside], place), shape=shape)
        normal = (jacobian.T @ jacobian).tocsc()
        scale = 1.0 / np.sqrt(normal.diagonal())
        solve = splu((sparse.diags(scale) @ normal @ sparse.diags(scale)).tocsc()).solve
        count = self._imu.size() + 1
        # Keys are in order of their letters: biases, gravity, then velocities and poses.
        wanted = [6 * k + i for k in nodes for i in range(6)] + [6 * count, 6 * count + 1]
        variance = np.empty(len(wanted))
        # One by one: all columns at once would be the greatest memory of a long drive.
        for k, entry in enumerate(wanted):
            unit = np.zeros(size)
            unit[entry] = 1.0
            variance[k] = solve(unit)[entry]
        sigma = scale[wanted] * np.sqrt(variance)
        bias = sigma[:-2].reshape(-1, 6)
        return Uncertainty(np.asarray(nodes, dtype=np.intp), bias[:, 3:], bias[:, :3], sigma[-2:])

    def _priors(self, start: Nodes) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        graph.add(gtsam.PriorFactorPose3(X(0), gtsam.Pose3(start.poses[0]), Sigmas(FIXED)))
        graph.add(gtsam.PriorFactorVector(V(0), start.velocities[0], Sigmas(FREE_VELOCITY)))
        sigmas = np.repeat([self._noise.accel_bias, self._noise.gyro_bias], 3)
        graph.add(gtsam.PriorFactorConstantBias(B(0), gtsam.imuBias.ConstantBias(), Sigmas(sigmas)))
        down = gtsam.Unit3(start.gravity / self._magnitude)
        graph.add(gtsam.PriorFactorUnit3(G(0), down, Sigmas(FREE_GRAVITY)))
        return graph


def residuals(nodes: Nodes, relative: Sequence[Between]) -> Array:
    """Normalised residual (R,) of each relative pose: root of chi^2 over its 6 components."""
    return np.array(
        [
            np.sqrt(error @ between.information @ error / 6)
            for between in relative
            for error in [between_error(nodes, between)]
        ]
    )


def between_error(nodes: Nodes, between: Between) -> Array:
    """What a relative pose measured less what the nodes say (6,): rad and m in the second node's axes."""
    said = gtsam.Pose3(np.linalg.inv(nodes.poses[between.first]) @ nodes.poses[between.second])
    return np.asarray(gtsam.Pose3.Logmap(gtsam.Pose3(between.first_from_second).inverse().compose(said)))


def write_g2o(nodes: Nodes, relative: Sequence[Between]) -> str:
    """Poses and relative poses in g2o's text format (VERTEX_SE3:QUAT, EDGE_SE3:QUAT), for other programs."""
    lines = []
    for k, pose in enumerate(nodes.poses):
        lines.append(f"VERTEX_SE3:QUAT {k} {_numbers(pose)}")
    for between in relative:
        # g2o orders translation before rotation, and its rotation is half ours: the quaternion's vector part.
        order = [3, 4, 5, 0, 1, 2]
        information = between.information[np.ix_(order, order)] * np.outer(
            [1, 1, 1, 2, 2, 2], [1, 1, 1, 2, 2, 2]
        )
        upper = " ".join(f"{value:.9g}" for value in information[np.triu_indices(6)])
        lines.append(
            f"EDGE_SE3:QUAT {between.first} {between.second} {_numbers(between.first_from_second)} {upper}"
        )
    return "\n".join(lines) + "\n"


def _numbers(pose: Array) -> str:
    values = [*pose[:3, 3], *quaternion_from_matrix(pose[:3, :3])[[1, 2, 3, 0]]]
    return " ".join(f"{value:.9f}" for value in values)


def _factor(between: Between) -> gtsam.BetweenFactorPose3:
    model = gtsam.noiseModel.Gaussian.Information(between.information)
    pose = gtsam.Pose3(between.first_from_second)
    return gtsam.BetweenFactorPose3(X(between.first), X(between.second), pose, model)


def _bias(nodes: Nodes, k: int) -> gtsam.imuBias.ConstantBias:
    return gtsam.imuBias.ConstantBias(nodes.accel_biases[k], nodes.gyro_biases[k])


def _values(nodes: Nodes, magnitude: float) -> gtsam.Values:
    values = gtsam.Values()
    for k in range(len(nodes.t_ns)):
        values.insert(X(k), gtsam.Pose3(nodes.poses[k]))
        values.insert(V(k), nodes.velocities[k])
        values.insert(B(k), _bias(nodes, k))
    values.insert(G(0), gtsam.Unit3(nodes.gravity / magnitude))
    return values


def _nodes(values: gtsam.Values, t_ns: NDArray[np.int64], magnitude: float) -> Nodes:
    count = range(len(t_ns))
    biases = [values.atConstantBias(B(k)) for k in count]
    return Nodes(
        t_ns,
        np.stack([values.atPose3(X(k)).matrix() for k in count]),
        np.stack([values.atVector(V(k)) for k in count]),
        np.stack([bias.gyroscope() for bias in biases]),
        np.stack([bias.accelerometer() for bias in biases]),
        magnitude * np.asarray(values.atUnit3(G(0)).point3()),
    )
