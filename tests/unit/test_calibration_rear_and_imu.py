"""The stage `rear and IMU` on a drive among planes: what it finds, what it says, and what it refuses."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from session_yard import DRAWN_M, Yard, drawing_document, yard

from card.artifacts import default_settings, read_json, write_json, write_table
from card.calibration.drive.state import corrections_row
from card.calibration.rear_and_imu import calibrate_rear_and_imu
from card.errors import CardError
from card.geometry import from_json, inverse, to_json
from card.recording.paths import LIDARS
from card.simulation.board_knowledge import front_lidar_document
from card.simulation.rig import LidarCorrections

Array = NDArray[np.float64]


def run(folder: Path, **changed: Any) -> dict[str, Any]:
    """The document that the stage writes for the drive in a folder."""
    settings = default_settings("calibration")
    settings["rear_and_imu"] |= changed
    calibrate_rear_and_imu(
        drive=folder / "drive",
        front_lidar=folder / "front_lidar.json",
        drawing=folder / "drawing.json",
        rear_and_imu=folder / "rear_and_imu.json",
        report=folder / "rear_and_imu.report.json",
        settings=settings,
        odometry_settings=default_settings("odometry"),
        gates=[],
        threads=2,
    )
    document: dict[str, Any] = read_json(folder / "rear_and_imu.json", "rear_and_imu_calibration")
    return document


def write(scene: Yard, folder: Path) -> Path:
    """The stage's inputs for a drive."""
    scene.write(folder)
    write_json(folder / "drawing.json", drawing_document(scene.drawn), "drawing")
    true = LidarCorrections(float(scene.truth.corrections[0, 0]))
    front = front_lidar_document(true, 5e-4, np.random.default_rng(0))
    write_json(folder / "front_lidar.json", front, "front_lidar_calibration")
    return folder


@pytest.fixture(scope="module")
def lively(tmp_path_factory: pytest.TempPathFactory) -> tuple[Yard, Path]:
    scene = yard(4, seconds=4.0, columns=60)
    return scene, write(scene, tmp_path_factory.mktemp("lively"))


@pytest.fixture
def broken(lively: tuple[Yard, Path], tmp_path: Path) -> Path:
    """A copy of the lively drive, to be broken."""
    shutil.copytree(lively[1], tmp_path / "session")
    return tmp_path / "session"


def errors(document: dict[str, Any], truth: Array, name: str) -> tuple[float, float]:
    """Angle (deg) and distance (mm) of a pose from the true one (4, 4)."""
    found = from_json(document["extrinsics"][name])
    turn = (np.trace(found[:3, :3].T @ truth[:3, :3]) - 1) / 2
    return float(np.degrees(np.arccos(min(turn, 1.0)))), float(1e3 * np.linalg.norm((found - truth)[:3, 3]))


def test_finds_rear_lidar_imu_and_channels(lively: tuple[Yard, Path]) -> None:
    scene, folder = lively
    document = run(folder)
    front, rear = scene.truth.mounted
    rear_deg, rear_mm = errors(document, inverse(front) @ rear, "lidar_front_from_lidar_rear")
    imu_deg, imu_mm = errors(document, front, "rig_from_lidar_front")
    assert rear_deg < 0.02
    assert rear_mm < 2.0
    assert imu_deg < 0.1
    assert imu_mm < 6.0
    for i, name in enumerate(LIDARS):
        off = corrections_row(document["corrections"][name]) - scene.truth.corrections[i]
        # Elevations, of which the ground tells most.
        assert np.degrees(np.abs(off[33:65]).mean()) < 0.005
        z = off / corrections_row(document["sigmas"][name])
        assert np.sqrt(np.mean(z**2)) < 2.0
    assert document["verdict"] == {"passed": True, "reasons": []}
    # Registering single sweeps is the second witness, without channels and along the odometry alone.
    assert document["quality"]["start_deg"] < 0.15
    assert document["quality"]["start_mm"] < 15
    assert document["observability"]["rear"]["rotation"] == "drive"
    report = json.loads((folder / "rear_and_imu.report.json").read_text())
    assert {figure["name"] for figure in report["figures"]} >= {"rear_sigma_deg", "imu_sigma_mm"}


def test_same_bytes_again(lively: tuple[Yard, Path], broken: Path) -> None:
    first = (lively[1] / "rear_and_imu.json").read_bytes()
    run(broken)
    assert (broken / "rear_and_imu.json").read_bytes() == first


def test_a_straight_level_drive_leaves_the_imu_to_the_drawing(tmp_path: Path) -> None:
    scene = yard(5, seconds=4.0, columns=60, lively=False)
    document = run(write(scene, tmp_path))
    entry = document["observability"]["imu"]
    assert entry["translation"] == "drawing"
    assert min(entry["translation_share"]) < 0.1
    # It lies between where its own drawing and that of the rear LiDAR have it.
    assert max(abs(value or 0.0) for value in entry["translation_off_sigmas"]) < 3.0
    assert np.allclose(entry["drawing_sigma_m"], DRAWN_M / np.sqrt(2), rtol=0.3)
    notes = json.loads((tmp_path / "rear_and_imu.report.json").read_text())["notes"]
    assert any("translation of IMU is that of the drawing" in note for note in notes)


def test_a_drive_without_rear_lidar(broken: Path) -> None:
    shutil.rmtree(broken / "drive" / "lidar_rear")
    with pytest.raises(CardError, match="without sweeps of lidar_rear"):
        run(broken)


def test_a_drive_that_is_too_short(broken: Path) -> None:
    with pytest.raises(CardError, match=r"too short.*3\.\d+ s.*at least 7 s"):
        run(broken, min_drive_s=7.0)


def test_axes_of_the_imu_are_confused(lively: tuple[Yard, Path], broken: Path) -> None:
    table = dict(lively[0].imu_table)
    table["gyro_x"], table["gyro_y"] = table["gyro_y"], table["gyro_x"]
    write_table(broken / "drive" / "imu.parquet", table, "imu")
    with pytest.raises(CardError, match="gyro agrees with the trajectory if read as rad/s with axes"):
        run(broken)


@pytest.mark.parametrize(
    ("sensor", "shift_m", "named"),
    [
        ("lidar_rear", [0.1, 0.0, 0.0], "translation of lidar_front_from_lidar_rear"),
        ("lidar_front", [0.0, 0.0, 0.0], "rotation of rig_from_lidar_front"),
    ],
)
def test_a_drawing_of_another_car(broken: Path, sensor: str, shift_m: list[float], named: str) -> None:
    drawing = read_json(broken / "drawing.json", "drawing")
    pose = drawing["extrinsics"][f"rig_from_{sensor}"]
    moved = from_json(pose)
    moved[:3, 3] += shift_m
    if sensor == "lidar_front":
        c, s = np.cos(0.05), np.sin(0.05)
        moved[:3, :3] = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ moved[:3, :3]
    drawing["extrinsics"][f"rig_from_{sensor}"] = pose | to_json(moved)
    write_json(broken / "drawing.json", drawing, "drawing")
    (broken / "rear_and_imu.json").unlink(missing_ok=True)
    with pytest.raises(CardError, match=f"{named} is not that of the drawing.*standard deviations off"):
        run(broken)
    assert not (broken / "rear_and_imu.json").exists()
