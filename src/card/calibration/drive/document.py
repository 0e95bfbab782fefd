"""The solution of a session's drive as document ``rear_and_imu_calibration``."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import Figure
from card.calibration.drive.batch import Priors, Solution, difference, matrices
from card.calibration.drive.inertial_kernels import UPPER
from card.calibration.drive.plane_kernels import CORRECTIONS
from card.calibration.drive.rays import Rays
from card.calibration.drive.start import FRONT, REAR, Alone
from card.calibration.drive.state import State, corrections_document
from card.estimation.imu import Imu
from card.geometry import inverse, to_json
from card.recording.paths import LIDARS

Array = NDArray[np.float64]
AXES = "xyz"
#: Share of the drawing's variance below which a drive says nothing.
NOTHING = 0.01


def in_target_frame(a_from_b: Array) -> Array:
    """From a pose's disturbance on its right to (6, 6) translation and rotation vector in frame a."""
    result = np.zeros((6, 6))
    result[:3, 3:] = result[3:, :3] = a_from_b[:3, :3]
    return result


def relative(mounted: Array) -> tuple[Array, Array]:
    """lidar_front_from_lidar_rear (4, 4), and its change (6, 12) by those of both mountings."""
    pose = inverse(mounted[FRONT]) @ mounted[REAR]
    x, y, z = pose[:3, 3]
    by = np.zeros((6, 12))
    by[:3, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    by[:3, 3:6] = by[3:, :3] = -np.eye(3)
    by[:3, 9:], by[3:, 6:9] = pose[:3, :3], pose[:3, :3]
    return pose, by


@dataclass(frozen=True)
class Knowledge:
    """Covariances (6, 6) of a pose, translation first, in its target frame.

    drawn : by the drawing of the pose.  tied : by all drawings, as the LiDARs tie them together, without
    what motion tells.  estimated : in the end.  off (6,) : estimate less drawing.
    """

    drawn: Array
    tied: Array
    estimated: Array
    off: Array

    def document(self, least: float) -> dict[str, Any]:
        """What the drive says beside the drawings: a part is its own if it took `least` of each variance."""
        estimated, tied = np.diag(self.estimated), np.diag(self.tied)
        share = 1.0 - estimated / tied
        # An estimate that is part drawing differs from it by what of its variance has gone.
        gone = np.diag(self.drawn) - estimated
        sure = gone > NOTHING * np.diag(self.drawn)
        sigmas = [float(o / np.sqrt(g)) if s else None for o, g, s in zip(self.off, gone, sure, strict=True)]
        document: dict[str, Any] = {}
        for name, unit, part in (("rotation", "rad", slice(3, 6)), ("translation", "m", slice(0, 3))):
            document |= {
                f"drawing_sigma_{unit}": np.sqrt(tied[part]).tolist(),
                f"{name}_sigma_{unit}": np.sqrt(estimated[part]).tolist(),
                f"{name}_share": share[part].tolist(),
                f"{name}_off_sigmas": sigmas[part],
                name: "drive" if share[part].min() >= least else "drawing",
            }
        return document


def known_of_imu(state: State, priors: Priors, both: Array) -> Knowledge:
    """rig_from_lidar_front.  both (12, 12) : covariance of the mountings, disturbed on their right."""
    front = state.mounted[FRONT]
    _, by = relative(state.mounted)
    follows = -np.linalg.solve(by[:, 6:], by[:, :6])
    drawn, rear = np.diag(priors.information(FRONT)), np.diag(priors.information(REAR))
    turn = in_target_frame(front)
    return Knowledge(
        turn @ np.linalg.inv(drawn) @ turn.T,
        turn @ np.linalg.inv(drawn + follows.T @ rear @ follows) @ turn.T,
        turn @ both[:6, :6] @ turn.T,
        turn @ difference(priors.mounted[FRONT], front),
    )


def known_of_rear(state: State, priors: Priors, both: Array) -> Knowledge:
    """lidar_front_from_lidar_rear.  both (12, 12) : as for the IMU."""
    pose, by = relative(state.mounted)
    information = np.concatenate([priors.information(FRONT), priors.information(REAR)])
    drawn = by @ np.diag(1.0 / information) @ by.T
    off = in_target_frame(pose) @ difference(relative(priors.mounted)[0], pose)
    return Knowledge(drawn, drawn, by @ both @ by.T, off)


def rear_and_imu_document(
    solution: Solution, priors: Priors, alone: Alone, rays: Rays, imu: Imu, settings: Mapping[str, Any]
) -> dict[str, Any]:
    """The document; see its schema."""
    state = solution.state
    both = solution.covariance[:12, :12]
    front, rear = state.mounted
    between, by = relative(state.mounted)
    turn = np.zeros((12, 12))
    turn[:6, :6], turn[6:, 6:] = in_target_frame(front), in_target_frame(rear)
    placed = turn @ both @ turn.T
    covariances = {
        "rig_from_lidar_front": placed[:6, :6],
        "rig_from_lidar_rear": placed[6:, 6:],
        "lidar_front_from_lidar_rear": by @ both @ by.T,
        "rig_from_lidar_front_and_rear": placed[:6, 6:],
    }
    sigma = np.sqrt(np.diag(solution.covariance))
    corrections_sigma = sigma[12 : 12 + 2 * CORRECTIONS].reshape(2, CORRECTIONS)
    document: dict[str, Any] = {
        "schema": "rear_and_imu_calibration",
        "extrinsics": {
            "rig_from_lidar_front": to_json(front),
            "rig_from_lidar_rear": to_json(rear),
            "lidar_front_from_lidar_rear": to_json(between),
        },
        "covariances": {
            name: (0.5 * (c + c.T) if name != "rig_from_lidar_front_and_rear" else c).tolist()
            for name, c in covariances.items()
        },
        "corrections": state.documents(),
        "sigmas": {
            name: corrections_document(row) for name, row in zip(LIDARS, corrections_sigma, strict=True)
        },
        "imu": _imu(solution, sigma[12 + 2 * CORRECTIONS :]),
        "observability": {
            "imu": known_of_imu(state, priors, both).document(settings["observed_share"]),
            "rear": known_of_rear(state, priors, both).document(settings["observed_share"]),
            "gyro_rms_rad_s": imu.gyro.std(axis=0).tolist(),
            "accel_rms_m_s2": imu.accel.std(axis=0).tolist(),
        },
        "quality": _quality(solution, priors, alone, rays),
    }
    reasons = _reasons(document, settings)
    return document | {"verdict": {"passed": not reasons, "reasons": reasons}}


def notes_of(document: Mapping[str, Any]) -> list[str]:
    """Which parts of a mounting a drive left to the drawing."""
    notes = []
    for name, what in (("imu", "IMU"), ("rear", "lidar_rear")):
        entry = document["observability"][name]
        for part, unit, scale in (("rotation", "deg", 180 / np.pi), ("translation", "mm", 1e3)):
            if entry[part] == "drawing":
                k = int(np.argmin(entry[f"{part}_share"]))
                sigma = scale * entry[f"{part}_sigma_{'rad' if part == 'rotation' else 'm'}"][k]
                notes.append(
                    f"{part} of {what} is that of the drawing: the drive excites it too little, "
                    f"least along {AXES[k]}, {sigma:.3g} {unit} one sigma"
                )
    return notes


def figures_of(document: Mapping[str, Any]) -> list[Figure]:
    """The figures of the report."""
    quality = document["quality"]
    between = np.sqrt(np.diag(document["covariances"]["lidar_front_from_lidar_rear"]))
    mounting = np.sqrt(np.diag(document["covariances"]["rig_from_lidar_front"]))
    return [
        Figure(
            "rear_sigma_deg", _deg(between[3:]), "deg", "standard deviation of rotation, rear against front"
        ),
        Figure("rear_sigma_mm", 1e3 * float(np.linalg.norm(between[:3])), "mm", "the same of position"),
        Figure(
            "imu_sigma_deg", _deg(mounting[3:]), "deg", "standard deviation of rotation, front in the rig"
        ),
        Figure("imu_sigma_mm", 1e3 * float(np.linalg.norm(mounting[:3])), "mm", "the same of position"),
        *(
            Figure(
                f"plane_rms_{name.removeprefix('lidar_')}_mm",
                1e3 * quality[name]["plane_rms_m"],
                "mm",
                f"root mean square distance of returns of {name} from their planes",
            )
            for name in LIDARS
        ),
        Figure("imu_residual", quality["imu_residual"], "1", "normalised residual of the IMU, rms"),
        Figure("rear_start_deg", quality["start_deg"], "deg", "angle to the rear LiDAR by single sweeps"),
        Figure("rear_start_mm", quality["start_mm"], "mm", "the same, distance"),
        Figure(
            "boards_sigmas", quality["boards_sigmas"], "1", "corrections of the front LiDAR: drive, boards"
        ),
    ]


def _imu(solution: Solution, sigma: Array) -> dict[str, Any]:
    state = solution.state
    gyro, accel = np.zeros((2, 3, 3))
    for u, entry in enumerate(UPPER):
        gyro[entry], accel[entry] = sigma[u], sigma[len(UPPER) + u]
    gyro_matrix, accel_matrix = matrices(state)
    return {
        "gyro_matrix": gyro_matrix.tolist(),
        "accel_matrix": accel_matrix.tolist(),
        "gyro_sigma": gyro.tolist(),
        "accel_sigma": accel.tolist(),
        "gyro_bias_rad_s": state.gyro_biases.mean(axis=0).tolist(),
        "accel_bias_m_s2": state.accel_biases.mean(axis=0).tolist(),
    }


def _quality(solution: Solution, priors: Priors, alone: Alone, rays: Rays) -> dict[str, Any]:
    state, fit = solution.state, solution.fit
    # Single sweeps were registered along the path of a front LiDAR that was mounted as drawn.
    single = inverse(priors.mounted[FRONT]) @ alone.rig_from_lidar
    start = difference(relative(state.mounted)[0], single)
    off = (state.corrections[FRONT] - priors.corrections[FRONT]) / priors.corrections_sigma[FRONT]
    return {
        "duration_s": float((state.t_ns[-1] - state.t_ns[0]) * 1e-9),
        "planes": fit.planes,
        **{
            name: {
                "sweeps": len(rays.sweeps_of(i)),
                "returns": int(fit.returns[i]),
                "on_planes": int(fit.on_planes[i]),
                "inliers": int(fit.inliers[i]),
                "plane_rms_m": float(fit.rms_m[i]),
            }
            for i, name in enumerate(LIDARS)
        },
        "imu_residual": float(np.sqrt(np.mean(solution.imu_residuals**2))),
        "last_step_deg": float(np.degrees(solution.steps[-1, 0])),
        "last_step_mm": float(1e3 * solution.steps[-1, 1]),
        "start_deg": float(np.degrees(np.linalg.norm(start[:3]))),
        "start_mm": float(1e3 * np.linalg.norm(start[3:])),
        "boards_sigmas": float(np.sqrt(np.mean(off**2))),
    }


def _reasons(document: Mapping[str, Any], settings: Mapping[str, Any]) -> list[str]:
    quality, reasons = document["quality"], []
    for name in LIDARS:
        entry = quality[name]
        share = entry["inliers"] / max(entry["on_planes"], 1)
        if share < settings["min_inlier_fraction"]:
            reasons.append(
                f"returns of {name} that fit: {share:.2f}, at least {settings['min_inlier_fraction']:g}"
            )
        if entry["plane_rms_m"] > settings["max_plane_rms_m"]:
            reasons.append(
                f"plane_rms_m of {name}: {entry['plane_rms_m']:.4f}, at most {settings['max_plane_rms_m']:g}"
            )
    for name, pose in (("rear", "lidar_front_from_lidar_rear"), ("imu", "rig_from_lidar_front")):
        sigma = np.sqrt(np.diag(document["covariances"][pose]))
        for unit, value in (("deg", np.degrees(sigma[3:].max())), ("mm", 1e3 * sigma[:3].max())):
            limit = settings[f"max_{name}_sigma_{unit}"]
            if value > limit:
                reasons.append(f"standard deviation of {pose}: {value:.3g} {unit}, at most {limit:g}")
    return reasons


def _deg(values: Array) -> float:
    return float(np.degrees(np.linalg.norm(values)))
