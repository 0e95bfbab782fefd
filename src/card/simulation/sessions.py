"""A calibration session: the board before a standing car, a short drive, and what the team made of it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder, progress, write_json
from card.artifacts.processes import in_processes
from card.geometry import CameraModel, from_json, to_json
from card.recording.laz import write_burst
from card.simulation.board_images import BoardCameras, write_board_yaml
from card.simulation.board_scene import board_quads, place_board, surroundings
from card.simulation.board_sweep import sweep
from card.simulation.calibrations import (
    delivered_calibration,
    session_rig,
    session_start_ns,
    true_calibration,
)
from card.simulation.ego import ego_pixels
from card.simulation.lidar import PERIOD_NS
from card.simulation.quads import Quad
from card.simulation.rig import Rig
from card.simulation.scales import scale_named
from card.simulation.session_drive import write_session_drive

_TILT_DEG = 16.0
_VIEW_NS = 2_000_000_000
# An image lies inside its sweep: the board stands still for longer than a turn.
_SWEEP_LEAD_NS = PERIOD_NS // 2


def simulate_session(
    session: str, *, folder: Path, truth: Path, scale: str, seed: int, threads: int = 1
) -> None:
    """Write one session.

    folder : gets board.yaml, camera_left|camera_right/<t_ns>.jpg, lidar_front/<t_ns>.laz, calibration.json
        (what the team delivers), ego_mask.png, drive/ (both LiDARs, the IMU, recording.yaml).
    truth : gets calibration.json, board_poses.json and the drive's truth in drive/.
    threads : processes that share the work; the bytes do not depend on it.
    """
    rig, count = session_rig(session, seed, scale), scale_named(scale).board_views
    with atomic_folder(truth) as truth_partial, atomic_folder(folder) as partial:
        write_board_yaml(partial)
        (partial / "lidar_front").mkdir()
        boards = _Boards(session, seed, scale, rig, partial)
        done = in_processes(boards.show, range(count), threads)
        views = list(progress(done, f"{session} board", count))
        calibration = delivered_calibration(session, seed, scale, views=count)
        write_json(partial / "calibration.json", calibration, "calibration")
        cv2.imwrite(str(partial / "ego_mask.png"), delivered_mask(calibration))
        write_json(truth_partial / "calibration.json", true_calibration(session, seed, scale), "calibration")
        poses = {"schema": "board_poses", "views": views, "stations": []}
        write_json(truth_partial / "board_poses.json", poses, "board_poses")
        write_session_drive(
            session,
            folder=partial / "drive",
            truth=truth_partial / "drive",
            scale=scale,
            seed=seed,
            threads=threads,
        )


@dataclass
class _Boards:
    """The board before the standing car, in one pose after the other; each view is random on its own."""

    session: str
    seed: int
    scale: str
    rig: Rig
    folder: Path

    def show(self, number: int) -> dict[str, Any]:
        """Photograph and scan view ``number``; its entry among the true board poses."""
        rng = np.random.default_rng([self.seed, number, *self.session.encode()])
        rig_from_board = place_board(self.rig, self._cameras.ego, rng, tilt_deg=_TILT_DEG)
        shown = board_quads(rig_from_board)
        t_ns = session_start_ns(self.session) + number * _VIEW_NS
        self._cameras.photograph(self.folder, shown, t_ns, rng)
        columns, start_ns = scale_named(self.scale).columns, t_ns - _SWEEP_LEAD_NS
        burst = sweep(self.rig, [*self._behind, *shown], columns, number, start_ns, rng)
        write_burst(self.folder / "lidar_front" / f"{burst.t_ns}.laz", burst)
        return {"folder": ".", "t_ns": t_ns, "rig_from_board": to_json(rig_from_board)}

    @cached_property
    def _behind(self) -> list[Quad]:
        return surroundings(np.random.default_rng([self.seed, *self.session.encode()]))

    @cached_property
    def _cameras(self) -> BoardCameras:
        return BoardCameras(self.rig, self._behind)


def delivered_mask(calibration: dict[str, Any]) -> NDArray[np.uint8]:
    """The mask (height, width) uint8 of the undistorted left image: 255 on the car and a rim around it."""
    camera = CameraModel.from_json(calibration["camera_left_undistorted"])
    body = ego_pixels(camera, from_json(calibration["extrinsics"]["rig_from_camera_left"]))
    rim = max(1, camera.width // 200)
    return np.asarray(cv2.dilate(body.astype(np.uint8) * 255, np.ones((2 * rim + 1,) * 2)), dtype=np.uint8)
