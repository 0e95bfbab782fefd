"""Rear LiDAR and IMU against the truth of simulated session drives at full size.

    python benchmarks/session_drives.py --seeds 5

simulates the drive of a session for so many cars under benchmarks/out/session_drives/, estimates, and writes
rows of the errors there; it prints what the sigmas make of them, too. A drive that is there is not simulated
again, and what was estimated is not estimated again.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from accuracy.calibration import angle_deg
from numpy.typing import NDArray
from rows import Row, publish
from scipy.spatial.transform import Rotation

from card.artifacts import atomic_folder, default_settings, read_json, write_json
from card.calibration.rear_and_imu import calibrate_rear_and_imu
from card.geometry import from_json, inverse
from card.simulation.board_knowledge import front_lidar_document
from card.simulation.calibrations import session_rig
from card.simulation.drawing import write_drawing
from card.simulation.session_drive import write_session_drive

Array = NDArray[np.float64]
OUT = Path(__file__).resolve().parent / "out" / "session_drives"
SESSION, SCALE = "2026-04-14-start", "full"
#: To which 150 boards tell the front LiDAR's range offset.
RANGE_SIGMA_M = 5e-4
THREADS = 2
AIMS = {"rear_deg": 0.005, "rear_mm": 1.0, "imu_deg": 0.02, "imu_mm": 6.0, "drive_cpu_s": 240.0}


def drive_of(session: str, seed: int, out: Path) -> Path:
    """The folder of the drive of a car's session, with the drawing; simulated if it is not there."""
    folder = out / f"{session}-{seed}"
    if not folder.is_dir():
        with atomic_folder(folder) as partial:
            ways = {"folder": partial / "drive", "truth": partial / "truth"}
            write_session_drive(session, **ways, scale=SCALE, seed=seed, threads=THREADS)
            write_drawing(partial / "drawing.json", SCALE)
    return folder


def calibrate(folder: Path, front_lidar: Path, result: Path) -> None:
    """The stage with a drive of `drive_of` and what boards tell of the front LiDAR; writes `result`."""
    calibrate_rear_and_imu(
        drive=folder / "drive",
        front_lidar=front_lidar,
        drawing=folder / "drawing.json",
        rear_and_imu=result,
        report=result.with_suffix(".report.json"),
        settings=default_settings("calibration"),
        odometry_settings=default_settings("odometry"),
        gates=[],
        threads=THREADS,
    )


def estimated(seed: int, out: Path) -> tuple[dict[str, Any], float]:
    """What the stage finds of a seed's drive if boards tell little, and its CPU time, s."""
    folder = drive_of(SESSION, seed, out)
    result, taken, boards = (folder / f"{n}.json" for n in ("rear_and_imu", "cpu_s", "front_lidar"))
    if not taken.is_file():
        true = session_rig(SESSION, seed, SCALE).lidar_corrections["lidar_front"]
        known = front_lidar_document(true, RANGE_SIGMA_M, np.random.default_rng([seed, 6]))
        write_json(boards, known, "front_lidar_calibration")
        start = time.process_time()
        calibrate(folder, boards, result)
        taken.write_text(json.dumps(time.process_time() - start))
    return read_json(result, "rear_and_imu_calibration"), json.loads(taken.read_text())


def errors_of(document: dict[str, Any], true: dict[str, Array]) -> dict[str, float]:
    """Errors of the rear LiDAR against the front one and of the front one in the rig, in deg and mm.

    With a suffix _nees, the normalised error squared of each, over its six dimensions.
    """
    errors = {}
    for name, pose in (("rear", "lidar_front_from_lidar_rear"), ("imu", "rig_from_lidar_front")):
        found = from_json(document["extrinsics"][pose])
        turn = found[:3, :3] @ true[pose][:3, :3].T
        off = np.concatenate([(found - true[pose])[:3, 3], Rotation.from_matrix(turn).as_rotvec()])
        errors[f"{name}_deg"], errors[f"{name}_mm"] = angle_deg(turn), 1e3 * float(np.linalg.norm(off[:3]))
        covariance = np.array(document["covariances"][pose])
        errors[f"{name}_nees"] = float(off @ np.linalg.solve(covariance, off)) / 6
    return errors


def truth_of(seed: int) -> dict[str, Array]:
    """The true poses."""
    front, rear = (session_rig(SESSION, seed, SCALE).rig_from[name] for name in ("lidar_front", "lidar_rear"))
    return {"rig_from_lidar_front": front, "lidar_front_from_lidar_rear": inverse(front) @ rear}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=OUT, help="where drives are and results go")
    options = parser.parse_args()
    found = []
    for seed in range(1, options.seeds + 1):
        document, seconds = estimated(seed, options.out)
        found.append(errors_of(document, truth_of(seed)) | {"drive_cpu_s": seconds})
        print(seed, {figure: round(value, 4) for figure, value in found[-1].items()}, flush=True)
    rows: list[Row] = []
    for figure, aim in AIMS.items():
        values, unit = [one[figure] for one in found], figure.rsplit("_", 1)[1]
        rows.append(_row(figure, float(np.median(values)), unit, aim))
        rows.append(_row(f"{figure}_p95", float(np.percentile(values, 95)), unit, None))
    publish(rows, options.out / "session-drives.json")


def _row(figure: str, value: float, unit: str, aim: float | None) -> Row:
    fields = {"stage": "calibration", "figure": figure, "value": value, "unit": unit, "aim": aim}
    return {**fields, "better": "lower"}


if __name__ == "__main__":
    main()
