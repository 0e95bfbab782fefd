"""What the batch leaves beside the trajectory: tables of nodes and loops, figures, notes on weak spots."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.estimation.batch import Batch, Between, Nodes, Uncertainty, between_error, residuals
from card.geometry import quaternion_from_matrix
from card.poses.refine import OUTLIER, Refined

Array = NDArray[np.float64]
AXES = ("x (across)", "y (along)", "z (up)")


def sigma_of(
    information: Array, registered: NDArray[np.bool_], settings: Mapping[str, Any]
) -> dict[str, Array]:
    """What each scan alone says of its place.

    sigma_m (N,) : in the weakest direction, NaN if not registered.  weak (N,) : whether that is left open.
    direction (N,) : the rig's axis nearest to it.
    """
    count = len(information)
    sigma, weak, direction = np.full(count, np.nan), ~registered, np.full(count, -1)
    for k in np.flatnonzero(registered):
        # Free of what the attitude leaves open.
        rotation, both, place = information[k, :3, :3], information[k, :3, 3:], information[k, 3:, 3:]
        values, vectors = np.linalg.eigh(place - both.T @ np.linalg.pinv(rotation) @ both)
        sigma[k] = settings["odometry_inflation"] / np.sqrt(max(values[0], 1e-12))
        weak[k] = sigma[k] > settings["weak_sigma_m"]
        direction[k] = int(np.argmax(np.abs(vectors[:, 0])))
    # The first sweep begins the map.
    if count > 1:
        sigma[0], weak[0], direction[0] = sigma[1], weak[1], direction[1]
    return {"sigma_m": sigma, "weak": weak, "direction": direction}


def node_columns(
    table: Any,
    nodes: Nodes,
    refined: Refined,
    batch: Batch,
    uncertainty: Uncertainty,
    sigma: Mapping[str, Array],
) -> dict[str, Any]:
    """The columns of schema ``pose_graph_nodes``; nodes in world, `table` that of the odometry."""
    count = np.arange(len(nodes.t_ns))
    odometry_residual: list[float | None] = [None] * len(count)
    for between, value in zip(refined.local, residuals(refined.nodes, refined.local), strict=True):
        odometry_residual[between.second] = float(value)
    columns: dict[str, Any] = {
        "t_ns": nodes.t_ns,
        "lidar": table["lidar"],
        "burst": table["burst"],
        "sigma_m": [None if np.isnan(value) else float(value) for value in sigma["sigma_m"]],
        "weak": sigma["weak"],
        "odometry_residual": odometry_residual,
        "imu_residual": [*map(float, batch.imu_residuals()), None],
        **_pose(nodes.poses),
    }
    vectors = {"v": nodes.velocities, "gyro_bias_": nodes.gyro_biases, "accel_bias_": nodes.accel_biases}
    for name in ("gyro", "accel"):
        known = getattr(uncertainty, f"{name}_biases")
        sigmas = [np.interp(count, uncertainty.nodes, known[:, axis]) for axis in range(3)]
        vectors[f"{name}_bias_sigma_"] = np.stack(sigmas, axis=1)
    for name, values in vectors.items():
        columns |= {f"{name}{axis}": values[:, i] for i, axis in enumerate("xyz")}
    return columns


def loop_columns(refined: Refined) -> dict[str, Any]:
    """The columns of schema ``loops``."""
    loops, t_ns = refined.loops, refined.nodes.t_ns
    errors = loop_errors(refined)
    found = np.stack([loop.found.map_from_scan for loop in loops]) if loops else np.zeros((0, 4, 4))
    return {
        "first_t_ns": t_ns[[loop.first for loop in loops]],
        "second_t_ns": t_ns[[loop.second for loop in loops]],
        **_pose(found),
        "inlier_fraction": [loop.inlier_fraction for loop in loops],
        "known_fraction": [loop.found.known_fraction for loop in loops],
        "rms_m": [loop.found.rms_m for loop in loops],
        "residual_m": np.linalg.norm(errors[:, 3:], axis=1),
        "residual_deg": np.degrees(np.linalg.norm(errors[:, :3], axis=1)),
        "weight": refined.weights,
        "accepted": refined.weights >= OUTLIER,
    }


def loop_errors(refined: Refined) -> Array:
    """Registered less solved (L, 6), rad and m."""
    errors = [
        between_error(refined.nodes, Between(loop.first, loop.second, loop.found.map_from_scan, np.eye(6)))
        for loop in refined.loops
    ]
    return np.array(errors).reshape(-1, 6)


def figures_of(
    columns: Mapping[str, Any], refined: Refined, uncertainty: Uncertainty, settings: Mapping[str, Any]
) -> tuple[list[Figure], list[str]]:
    """Figures of the batch, and notes on what it leaves weakly determined."""
    spans = weak_spans(columns["t_ns"], np.asarray(columns["weak"]), settings["weak_s"])
    good = refined.weights >= OUTLIER
    errors = np.linalg.norm(loop_errors(refined)[good][:, 3:], axis=1)
    chained = [value for value in columns["odometry_residual"] if value is not None]
    inertial = [value for value in columns["imu_residual"] if value is not None]
    figures = [
        Figure("loops", float(good.sum()), "1", "loops that count"),
        Figure("loops_rejected", float((~good).sum()), "1", "proved loops that the robust solution rejects"),
        Figure("loop_residual_mm", _median(1e3 * errors), "mm", "registered against solved place, median"),
        Figure("loop_residual_max_mm", _largest(1e3 * errors), "mm", "the same, greatest"),
        Figure("odometry_residual", _rms(chained), "1", "normalised residual against the local map, rms"),
        Figure("imu_residual", _rms(inertial), "1", "normalised residual of the IMU, rms"),
        Figure(
            "gravity_sigma_deg",
            float(np.degrees(np.linalg.norm(uncertainty.gravity))),
            "deg",
            "standard deviation of the direction of up",
        ),
        Figure(
            "weak_pct",
            100 * float(np.mean(columns["weak"])),
            "%",
            "sweeps that leave a direction of their place open",
        ),
        Figure(
            "longest_weak_s",
            max(((end - start) * 1e-9 for start, end in spans), default=0.0),
            "s",
            "longest time that the IMU alone has to bridge",
        ),
    ]
    notes = [
        f"weakly determined for {(end - start) * 1e-9:.1f} s, {start}..{end} ns: scans leave a direction open"
        for start, end in spans
    ]
    if not refined.loops:
        notes.append("no loop: drift over the whole drive is not corrected by revisits")
    return figures, notes


def weak_spans(t_ns: NDArray[np.int64], weak: NDArray[np.bool_], least_s: float) -> list[tuple[int, int]]:
    """Spans of time (ns) that hold only weak nodes, longer than `least_s`."""
    inside = np.flatnonzero(weak)
    runs = np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1) if len(inside) else []
    spans = [(int(t_ns[run[0]]), int(t_ns[run[-1]])) for run in runs]
    return [span for span in spans if span[1] - span[0] > least_s * 1e9]


def _pose(poses: Array) -> dict[str, Array]:
    quaternion = quaternion_from_matrix(poses[:, :3, :3])
    columns = {axis: poses[:, i, 3] for i, axis in enumerate("xyz")}
    return columns | {f"q{axis}": quaternion[:, i] for i, axis in enumerate("wxyz")}


def _median(values: Array) -> float | None:
    return float(np.median(values)) if len(values) else None


def _largest(values: Array) -> float | None:
    return float(values.max()) if len(values) else None


def _rms(values: list[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None
