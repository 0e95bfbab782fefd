"""Both stages of the poses on a street, as tests call them."""

from pathlib import Path
from typing import Any

import numpy as np
from street_scene import Street

from card.artifacts import default_settings, read_json, read_table
from card.geometry import Trajectory
from card.poses.anchor import anchor
from card.poses.estimate_odometry import estimate_odometry
from card.poses.pose_graph import refine_odometry


def run(folder: Path, odometry: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """Both stages, the first with changed settings of its own; the report of the second."""
    files = {name: folder / f"{name}.parquet" for name in ("bursts", "odometry", "nodes", "loops")}
    shared = {"recording": folder, "calibration": folder / "calibration.json", "gates": []}
    stage_1 = default_settings("odometry") | (odometry or {})
    if not files["odometry"].exists():
        estimate_odometry(
            **shared,
            bursts=files["bursts"],
            odometry=files["odometry"],
            report=folder / "odometry.report.json",
            settings=stage_1,
        )
    refine_odometry(
        **shared,
        **files,
        trajectory=folder / "refined.parquet",
        g2o=folder / "graph.g2o",
        report=folder / "pose_graph.report.json",
        settings=default_settings("pose_graph") | changes,
        odometry_settings=stage_1,
    )
    return read_json(folder / "pose_graph.report.json", "report")


def figures(report: dict[str, Any]) -> dict[str, float]:
    return {figure["name"]: figure["value"] for figure in report["figures"]}


def refined(folder: Path) -> Trajectory:
    return Trajectory.from_table(read_table(folder / "refined.parquet", "trajectory"))


def expected(street: Street, t_ns: np.ndarray) -> np.ndarray:
    """True poses (N, 4, 4) in the world of the design: origin and heading of the first."""
    return anchor(street.poses(t_ns), np.array([0, 0, 1.0]))
