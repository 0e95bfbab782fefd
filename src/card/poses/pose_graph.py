"""The stage `pose_graph`: from the odometry to the refined trajectory of a drive."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_file, read_table, write_report, write_table
from card.estimation.batch import Batch, Nodes, write_g2o
from card.estimation.dense import dense_trajectory
from card.estimation.imu import ImuNoise
from card.estimation.odometry import plane_settings
from card.geometry import Trajectory, inverse, quaternion_from_matrix
from card.poses.anchor import anchor
from card.poses.appearance import returns
from card.poses.graph_tables import figures_of, loop_columns, node_columns, sigma_of
from card.poses.inputs import open_imu, open_scans
from card.poses.loops import LoopVerifier
from card.poses.refine import local_constraints, refine
from card.poses.sweep_store import SweepStore, along_nodes
from card.recording.description import read_description
from card.recording.paths import imu_path

Array = NDArray[np.float64]
#: Nodes at which the uncertainty of the biases is worked out.
SIGMA_NODES = 50


def refine_odometry(
    *,
    recording: Path,
    calibration: Path,
    bursts: Path,
    odometry: Path,
    trajectory: Path,
    nodes: Path,
    loops: Path,
    g2o: Path,
    report: Path,
    settings: Mapping[str, Any],
    odometry_settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Solve a drive as one batch of IMU, odometry and loops.

    Parameters
    ----------
    recording : folder with ``recording.yaml``, ``imu.parquet`` and the sweeps.
    calibration, bursts, odometry : artifacts of schemas ``calibration``, ``bursts`` and ``odometry_states``.
    trajectory, nodes, loops, g2o, report : the files to write, of schemas ``trajectory`` (world, IMU rate),
        ``pose_graph_nodes``, ``loops``, g2o's text format, and ``report``.
    odometry_settings : those that the odometry was made with.
    """
    imu = open_imu(recording, calibration)
    table = read_table(odometry, "odometry_states")
    start, information, registered = _read_odometry(table)
    scans = open_scans(recording, bursts, calibration, odometry_settings)
    store = SweepStore(
        scans, _sweeps(table, scans), along_nodes(start, imu), odometry_settings["map_points_leaf_m"]
    )
    search = {**settings, "scan_leaf_m": odometry_settings["scan_leaf_m"]}
    verifier = LoopVerifier(store, plane_settings(odometry_settings), search)
    batch = Batch(imu, start, ImuNoise.from_settings(odometry_settings))
    local = local_constraints(start, information, registered, settings)
    seen = returns(start.poses, store.points, settings) if settings["appearance"] else []
    known = [verifier.verify_at(start.poses, *pair) for pair in seen]
    refined = refine(batch, start, local, verifier.verify, settings, known)
    picked = np.unique(np.linspace(0, len(start.t_ns) - 1, SIGMA_NODES).astype(int))
    uncertainty = batch.uncertainty([int(k) for k in picked])

    dense = dense_trajectory(refined.nodes, imu, settings["beyond_s"])
    world_from_odometry = _world(dense, refined.nodes.gravity)
    in_world = _moved(refined.nodes, world_from_odometry)
    sigma = sigma_of(information, registered, settings)
    columns = node_columns(table, in_world, refined, batch, uncertainty, sigma)
    figures, notes = figures_of(columns, refined, uncertainty, settings)

    write_table(trajectory, _placed(dense, world_from_odometry).to_table(), "trajectory")
    write_table(nodes, columns, "pose_graph_nodes")
    write_table(loops, loop_columns(refined), "loops")
    betweens = [*refined.local, *(loop.between(settings["loop_inflation"]) for loop in refined.loops)]
    with atomic_file(g2o) as partial:
        partial.write_text(write_g2o(in_world, betweens), encoding="ascii")
    write_report(
        report,
        stage="pose_graph",
        sequence=read_description(recording)["id"],
        settings=settings,
        inputs={
            "calibration": calibration,
            "bursts": bursts,
            "odometry": odometry,
            "imu": imu_path(recording),
        },
        counts={"nodes": len(start.t_ns), "loops_tried": refined.tried, "loops_proved": len(refined.loops)},
        figures=figures,
        gates=gates,
        notes=notes,
    )


def _read_odometry(table: Any) -> tuple[Nodes, Array, NDArray[np.bool_]]:
    """States (N), information (N, 6, 6) of the scans alone, and which of them were registered."""
    path = Trajectory.from_table(table)

    def vector(name: str) -> Array:
        return np.stack([table[f"{name}{axis}"].to_numpy() for axis in "xyz"], axis=1)

    information = np.empty((len(path.t_ns), 6, 6))
    for i in range(6):
        for j in range(i, 6):
            information[:, i, j] = information[:, j, i] = table[f"information_{i}{j}"].to_numpy()
    nodes = Nodes(
        path.t_ns,
        path.at(path.t_ns),
        vector("v"),
        vector("gyro_bias_"),
        vector("accel_bias_"),
        vector("gravity_")[-1],
    )
    return nodes, information, np.array(table["registered"].to_pylist(), dtype=bool)


def _sweeps(table: Any, scans: Any) -> NDArray[np.intp]:
    """Ordinal of each row's sweep among the scans."""
    place = {
        (lidar, int(burst)): i for i, (lidar, burst) in enumerate(zip(scans.lidar, scans.burst, strict=True))
    }
    keys = zip(table["lidar"].to_pylist(), table["burst"].to_pylist(), strict=True)
    return np.array([place[key] for key in keys], dtype=np.intp)


def _world(dense: Trajectory, gravity: Array) -> Array:
    """world_from_odometry (4, 4): z against gravity, origin and heading of the first pose (design 1)."""
    first = dense.at(dense.start_ns)
    return np.asarray(anchor(first[None], -gravity / np.linalg.norm(gravity))[0] @ inverse(first))


def _moved(nodes: Nodes, world_from_odometry: Array) -> Nodes:
    turn = world_from_odometry[:3, :3]
    return replace(
        nodes,
        poses=world_from_odometry @ nodes.poses,
        velocities=nodes.velocities @ turn.T,
        gravity=turn @ nodes.gravity,
    )


def _placed(dense: Trajectory, world_from_odometry: Array) -> Trajectory:
    poses = world_from_odometry @ dense.at(dense.t_ns)
    return Trajectory(dense.t_ns, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3]))
