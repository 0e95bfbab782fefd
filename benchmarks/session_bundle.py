"""The calibration that a session of a simulated car ends in: by the project's own steps, at full size.

    python benchmarks/session_bundle.py 2026-04-14-start 2026-04-14-end --seeds 1 2

estimates the bundles of these sessions under benchmarks/out/session_drives/ and prints their errors. The
corners of 150 boards come from projection with noise instead of a search in images; the sweeps that see the
boards, the session's drive and all that follows are as in the pipeline. Wheels are not surveyed: they are
those of the drawing.
"""

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from accuracy.calibration import bundle_errors
from board_sessions import NOISE_PX
from session_drives import OUT, SCALE, calibrate, drive_of

from card.artifacts import atomic_folder, default_settings, read_json, write_json
from card.calibration.bundle import bundle_of
from card.calibration.cameras import calibrate_cameras
from card.calibration.checks import WHEELS
from card.calibration.front_lidar import calibrate_front_lidar
from card.geometry import apply, from_json, inverse
from card.simulation.board_images import write_board_yaml
from card.simulation.board_observations import board_places, observe, write_observations
from card.simulation.calibrations import session_rig, true_calibration

BOARDS, COLUMNS = 150, 2000


def bundle_at(session: str, seed: int, out: Path = OUT) -> Path:
    """The file of the bundle (schema ``calibration``) that a car's session ends in, estimated once."""
    folder = drive_of(session, seed, out)
    if not (folder / "bundle").is_dir():
        drawing = read_json(folder / "drawing.json", "drawing")
        with atomic_folder(folder / "bundle") as partial:
            front, rear = partial / "front_lidar.json", partial / "rear_and_imu.json"
            _boards(session, seed, folder / "drawing.json", partial)
            calibrate(folder, front, rear)
            steps = {
                "front_lidar": read_json(front, "front_lidar_calibration"),
                "rear_and_imu": read_json(rear, "rear_and_imu_calibration"),
                "rig_wheels": _drawn_wheels(drawing),
            }
            write_json(partial / "calibration.json", bundle_of(session, steps, drawing), "calibration")
    return folder / "bundle" / "calibration.json"


def _boards(session: str, seed: int, drawing: Path, folder: Path) -> None:
    """Both steps that boards are for; what they read and write goes to `folder`."""
    rig, rng = session_rig(session, seed, SCALE), np.random.default_rng([seed, *session.encode()])
    observed = observe(rig, board_places(rig, BOARDS, rng), noise_px=NOISE_PX, columns=COLUMNS, rng=rng)
    boards = folder / "boards.parquet"
    write_observations(observed, rig, session=folder, boards=boards)
    write_board_yaml(folder)
    shared: dict[str, Any] = {"settings": default_settings("calibration"), "gates": []}
    shared |= {"boards": boards, "board": folder / "board.yaml", "cameras": folder / "cameras.json"}
    calibrate_cameras(report=folder / "cameras.report.json", **shared)
    calibrate_front_lidar(
        session=folder,
        drawing=drawing,
        front_lidar=folder / "front_lidar.json",
        report=folder / "front_lidar.report.json",
        **shared,
    )


def _drawn_wheels(drawing: dict[str, Any]) -> dict[str, Any]:
    """The drawing's wheels in the form of a survey's."""
    front = inverse(from_json(drawing["extrinsics"]["rig_from_lidar_front"]))
    wheels = {
        wheel: {
            name: apply(front, np.array([drawing["wheels"][wheel][name]]))[0]
            for name in ("center_m", "contact_m")
        }
        for wheel in WHEELS
    }
    sigma = np.repeat([drawing["wheels"][wheel]["sigma_m"] for wheel in WHEELS], 6)
    return {
        "lidar_front": {"wheels": wheels, "covariance": np.diag(sigma**2)},
        "quality": {"spread_mm": 0.0},
        "verdict": {"reasons": []},
    }


def main() -> None:
    """Estimate the bundles that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sessions", nargs="+", help="<day>-start, -mid or -end")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--out", type=Path, default=OUT, help="where drives are and results go")
    options = parser.parse_args()
    for seed in options.seeds:
        for session in options.sessions:
            found = read_json(bundle_at(session, seed, options.out), "calibration")
            errors = bundle_errors(found, true_calibration(session, seed, SCALE))
            del errors["wheel_contact_mm"]
            print(session, seed, {name: round(value, 4) for name, value in errors.items()}, flush=True)


if __name__ == "__main__":
    main()
