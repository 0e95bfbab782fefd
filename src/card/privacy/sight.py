"""How far away what a box shows is, and where it is in another image if it stands still."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json, read_table
from card.errors import CardError
from card.estimation.deskew import deskew_burst
from card.geometry import CameraModel, Trajectory, apply, from_json, inverse
from card.recording.laz import read_burst

Array = NDArray[np.float64]
Edges = tuple[float, float, float, float]

# A box without returns of its own is as far away as what lies round it.
_LOOK_AROUND = 0.5
# Of the returns in a box, those of the thing itself are the nearer ones.
_NEARER_SHARE_PCT = 25.0


class Sight:
    """Cameras on a moving car, with single LiDAR sweeps for depth.

    Parameters
    ----------
    recording : folder the bursts' files are relative to.
    calibration, trajectory, bursts : artifacts of the sequence.
    """

    def __init__(self, recording: Path, calibration: Path, trajectory: Path, bursts: Path) -> None:
        document = read_json(calibration, "calibration")
        self._cameras = {name: CameraModel.from_json(model) for name, model in document["cameras"].items()}
        self._rig_from = {
            name.removeprefix("rig_from_"): from_json(pose) for name, pose in document["extrinsics"].items()
        }
        self._corrections: Mapping[str, Any] = document["lidar_corrections"]
        self._trajectory = Trajectory.from_table(read_table(trajectory, "trajectory"))
        self._recording = recording
        rows = [row for row in read_table(bursts, "bursts").to_pylist() if row["lidar"] == "lidar_front"]
        self._burst_ns = np.array([row["t_start_ns"] for row in rows], dtype=np.int64)
        self._files = [row["file"] for row in rows]

    def depths(self, camera: str, t_ns: int, boxes: list[Edges]) -> list[float]:
        """Depth, m, of what each box (edges in px) shows; inf where no return says."""
        found = self._sweep(camera, t_ns) if boxes else None
        if found is None:
            return [np.inf] * len(boxes)
        pixels, depth = found
        result = []
        for x_min, y_min, x_max, y_max in boxes:
            for margin in (0.0, _LOOK_AROUND):
                dx, dy = margin * (x_max - x_min), margin * (y_max - y_min)
                low, high = (x_min - dx, y_min - dy), (x_max + dx, y_max + dy)
                inside = np.all((pixels >= low) & (pixels <= high), axis=1)
                if inside.any():
                    break
            result.append(float(np.percentile(depth[inside], _NEARER_SHARE_PCT)) if inside.any() else np.inf)
        return result

    def moved(self, edges: Edges, depth: float, start: tuple[str, int], end: tuple[str, int]) -> Edges | None:
        """Edges in image ``end`` (camera, t_ns) of what a box at a depth (m) in image ``start`` shows.

        It is taken to stand still and to face the camera; None where it is not in front of the other camera.
        """
        far = depth if np.isfinite(depth) else 1e4
        x_min, y_min, x_max, y_max = edges
        corners = [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max)]
        try:
            end_from_start = inverse(self._world_from(*end)) @ self._world_from(*start)
        except CardError:
            return None
        points = apply(end_from_start, far * self._cameras[start[0]].rays(corners))
        pixels = self._cameras[end[0]].project(points)
        if not np.isfinite(pixels).all():
            return None
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])

    def _world_from(self, camera: str, t_ns: int) -> Array:
        return self._trajectory.at(t_ns) @ self._rig_from[camera]

    def _sweep(self, camera: str, t_ns: int) -> tuple[Array, Array] | None:
        """Pixels (N, 2) and depths (N,) of the sweep nearest in time; None where no pose is."""
        if not len(self._files):
            return None
        nearest = int(np.abs(self._burst_ns - t_ns).argmin())
        burst = read_burst(self._recording / self._files[nearest], intensity=False)
        try:
            world = deskew_burst(
                burst, self._rig_from["lidar_front"], self._trajectory, self._corrections.get("lidar_front")
            )
            points = apply(inverse(self._world_from(camera, t_ns)), world)
        except CardError:
            return None
        pixels = self._cameras[camera].project(points)
        seen = np.isfinite(pixels).all(axis=1)
        return pixels[seen], points[seen, 2]
