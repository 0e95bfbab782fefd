"""Where the station of a survey stood in the left camera: all poses of the board refined together.

Unknowns are the station's pose in the left camera and the board's in each of its poses; observations are the
board's corners in both images and its marked points in the survey. The cameras stay as they are.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from card.calibration.corner_residuals import Corners, skew
from card.calibration.front_sensors import CAMERA_PARAMETERS, FrontSensors
from card.calibration.residuals import Linear
from card.calibration.state import State, moved
from card.errors import CardError
from card.geometry import apply
from card.geometry.rigid_alignment import align

Array = NDArray[np.float64]

_MOST_STEPS = 200
_STEP = 1e-8


@dataclass(frozen=True)
class Observed:
    """What is known of a board in one survey's poses.

    corners : (N, 3) and marks (M, 3) in the board frame, metres.
    pixels : (P, 2, N, 2) of the corners in the left and the right image; NaN where one is not used.
    surveyed : (P, M, 3) of the marks in the frame of the station, metres; NaN where not measured.
    """

    corners: Array
    marks: Array
    pixels: Array
    surveyed: Array

    def without(self, pose: int) -> "Observed":
        """The same without one pose of the board."""
        return replace(
            self, pixels=np.delete(self.pixels, pose, axis=0), surveyed=np.delete(self.surveyed, pose, axis=0)
        )


@dataclass(frozen=True)
class Alignment:
    """The fit.

    left_from_station : (4, 4).
    covariance : (6, 6) of it from corners and survey, translation then rotation vector, in the left camera.
    by_cameras : (6, 24) how it moves with the cameras' parameters.
    closed_form : left_from_station (4, 4) by `rigid_alignment.align` of the marks, the board taken where the
        images have it.
    corner_px, mark_m : residuals, NaN where nothing was observed.
    corner_freedom, mark_freedom : their degrees of freedom.
    """

    left_from_station: Array
    covariance: Array
    by_cameras: Array
    closed_form: Array
    corner_px: Array
    mark_m: Array
    corner_freedom: float
    mark_freedom: float

    @property
    def corner_rms_px(self) -> float:
        """Standard deviation of a corner's coordinate that the residuals tell, px."""
        return float(np.sqrt(np.nansum(self.corner_px**2) / self.corner_freedom))

    @property
    def mark_rms_m(self) -> float:
        """Standard deviation of a surveyed coordinate that the residuals tell, m."""
        return float(np.sqrt(np.nansum(self.mark_m**2) / self.mark_freedom))


def align_station(
    sensors: FrontSensors, observed: Observed, boards: Array, corner_sigma_px: float, survey_sigma_m: float
) -> Alignment:
    """Fit one survey.

    boards : (P, 4, 4) poses of the board in the left camera to start from.

    Raises
    ------
    CardError
        If the fit does not settle.
    """
    there = np.isfinite(observed.surveyed[..., 0])
    in_left = np.stack([apply(pose, observed.marks) for pose in boards])
    station = closed_form = align(in_left[there], observed.surveyed[there])
    sigmas = (corner_sigma_px, survey_sigma_m)
    for _ in range(_MOST_STEPS):
        residuals, jacobians, _ = _linear(sensors, observed, station, boards, sigmas)
        step = _solved(np.concatenate(jacobians), -np.concatenate(residuals))
        station, boards = moved(station, step[:6]), moved(boards, step[6:].reshape(-1, 6))
        if np.abs(step).max() < _STEP:
            break
    else:
        raise CardError("survey does not settle", found=f"last step {np.abs(step).max():.2g}")
    (corners, marks), jacobians, by_cameras = _linear(sensors, observed, station, boards, sigmas)
    whole = np.concatenate(jacobians)
    covariance = np.asarray(np.linalg.inv(whole.T @ whole), dtype=np.float64)
    freedom = [len(jacobian) - float(np.sum(covariance * (jacobian.T @ jacobian))) for jacobian in jacobians]
    return Alignment(
        station,
        covariance[:6, :6],
        -covariance[:6] @ jacobians[0].T @ by_cameras,
        closed_form,
        corners * corner_sigma_px,
        marks * survey_sigma_m,
        *freedom,
    )


def _solved(matrix: Array, values: Array) -> Array:
    return np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)


def _linear(
    sensors: FrontSensors, observed: Observed, station: Array, boards: Array, sigmas: tuple[float, float]
) -> tuple[list[Array], list[Array], Array]:
    """Residuals of corners and of marks in sigmas, derivatives by the unknowns, of corners by cameras too."""
    state = State(sensors.intrinsics, sensors.left_from_right, np.eye(4), np.zeros(97), boards)
    poses, unknowns = len(boards), 6 + 6 * len(boards)
    residuals, by_unknowns, by_cameras = [], [], []
    for side in range(2):
        block = Corners(side, observed.corners, observed.pixels[:, side])
        linear: Linear = block.linear(state)
        own = np.zeros((*linear.residual.shape, unknowns))
        shared = np.zeros((*linear.residual.shape, CAMERA_PARAMETERS))
        for pose in range(poses):
            own[pose, :, 6 + 6 * pose : 12 + 6 * pose] = linear.pose[pose]
        shared[..., block.columns] = linear.shared
        seen = np.isfinite(linear.residual)
        residuals.append(linear.residual[seen] / sigmas[0])
        by_unknowns.append(own[seen] / sigmas[0])
        by_cameras.append(shared[seen] / sigmas[0])
    mark_residual, mark_jacobian = _marks(observed, station, boards)
    return (
        [np.concatenate(residuals), mark_residual / sigmas[1]],
        [np.concatenate(by_unknowns), mark_jacobian / sigmas[1]],
        np.concatenate(by_cameras),
    )


def _marks(observed: Observed, station: Array, boards: Array) -> tuple[Array, Array]:
    """Marks on the board less those of the survey, in the left camera, (K,), and derivatives (K, 6 + 6 P)."""
    residuals, rows = [], []
    for pose, board in enumerate(boards):
        there = np.isfinite(observed.surveyed[pose, :, 0])
        on_board = observed.marks[there] @ board[:3, :3].T
        in_survey = observed.surveyed[pose, there] @ station[:3, :3].T
        residuals.append(on_board + board[:3, 3] - in_survey - station[:3, 3])
        row = np.zeros((int(there.sum()), 3, 6 + 6 * len(boards)))
        row[..., :3], row[..., 3:6] = -np.eye(3), skew(in_survey)
        row[..., 6 + 6 * pose : 9 + 6 * pose] = np.eye(3)
        row[..., 9 + 6 * pose : 12 + 6 * pose] = -skew(on_board)
        rows.append(row.reshape(-1, row.shape[-1]))
    return np.concatenate(residuals).ravel(), np.concatenate(rows)
