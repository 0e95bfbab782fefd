"""The wheels stage on a synthetic drive: LAZ bursts of a road whose height is known."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from card.artifacts import (
    default_settings,
    read_arrays,
    read_json,
    read_table,
    write_arrays,
    write_json,
    write_table,
)
from card.errors import CardError
from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory, apply, from_json, height_above_road, inverse
from card.recording.burst import Burst
from card.recording.laz import read_burst, write_burst
from card.simulation.calibrations import true_calibration
from card.wheels import excite
from card.wheels.contact_path import contact_path
from card.wheels.crop import Track, crop_burst
from card.wheels.static_points import StaticVoxels

Array = NDArray[np.float64]
START_NS = 1_776_153_600_000_000_000
BURST_NS = 100_000_000
WHEELS = ("fl", "fr", "rl", "rr")
VOXEL_M = 0.1


def road(x: Array, y: Array) -> Array:
    """A climbing road with a bump 7 cm high and 3 m long at y = 14 m on its right half only."""
    bump = np.where(np.abs(y - 14) < 1.5, 0.035 * (1 + np.cos(np.pi * (y - 14) / 1.5)), 0.0)
    return 0.02 * y + np.where(x > 0, bump, 0.0)


def along(t: Array) -> Array:
    """Metres driven: 5 m/s, a stop from 2 to 3 s, on at 5 m/s, from 7 s slowly back."""
    return np.interp(t, [0, 2, 3, 7, 7.5, 10], [0, 10, 10, 30, 30, 26])


def trajectory() -> Trajectory:
    t = np.arange(0, 10, 0.01)
    y = along(t)
    position = np.stack([0.1 * np.sin(0.3 * y), y, 1.7 + 0.02 * y + 0.008 * np.sin(5 * t)], axis=1)
    angles = np.stack([-0.03 * np.cos(0.3 * y), 0.02 + 0.005 * np.sin(4 * t), 0.005 * np.sin(3 * t)], axis=1)
    quaternion = Rotation.from_euler("ZXY", angles).as_quat()[:, [3, 0, 1, 2]]
    return Trajectory(START_NS + np.round(t * 1e9).astype(np.int64), position, quaternion)


def scan(path: Trajectory, rig_from_lidar: Array, t_ns: int, sign: int, rng: np.random.Generator) -> Burst:
    """Ground returns 3 to 14 m before (sign 1) or behind (-1) the sensor, skewed by the car's motion."""
    offset = np.sort(rng.integers(0, BURST_NS - 1_000_000, 4000)).astype(np.uint32)
    world_from_lidar = path.at(t_ns + offset.astype(np.int64)) @ rig_from_lidar
    x = rng.uniform(-2.5, 2.5, offset.size)
    y = world_from_lidar[:, 1, 3] + sign * rng.uniform(3, 14, offset.size)
    world = np.stack([x, y, road(x, y)], axis=1)
    points = apply(inverse(world_from_lidar), world)
    grey = np.zeros(offset.size, dtype=np.uint8)
    return Burst(t_ns, points, grey, grey, offset)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drive")
    rng = np.random.default_rng(0)
    bundle = true_calibration("2026-04-14-start", 1, "tiny")
    for corrections in bundle["lidar_corrections"].values():
        corrections |= {name: 0.0 if name == "range_offset_m" else [0.0] * 32 for name in corrections}
    write_json(folder / "calibration.json", bundle, "calibration")
    lidar = {"model": "XT32", "clock": "synchronised", "deskewed": False}
    description = {"id": "drive", "rig": "r", "day": "2026-04-14", "place": "p", "country": "DE"}
    description |= {"sensors": {"lidar_front": lidar, "lidar_rear": lidar}}
    (folder / "recording.yaml").write_text(yaml.safe_dump(description))
    path = trajectory()
    write_table(folder / "trajectory.parquet", path.to_table(), "trajectory")

    rows: dict[str, list[Any]] = {
        n: [] for n in ("lidar", "burst", "t_start_ns", "t_end_ns", "points", "file")
    }
    voxels = []
    for name, sign in (("lidar_front", 1), ("lidar_rear", -1)):
        (folder / name).mkdir()
        rig_from_lidar = from_json(bundle["extrinsics"][f"rig_from_{name}"])
        for number in range(99):
            burst = scan(path, rig_from_lidar, START_NS + number * BURST_NS, sign, rng)
            write_burst(folder / name / f"{burst.t_ns}.laz", burst)
            row = (name, number, burst.t_ns, burst.end_ns, len(burst), f"{name}/{burst.t_ns}.laz")
            for column, value in zip(rows.values(), row, strict=True):
                column.append(value)
            world = deskew_burst(burst, rig_from_lidar, path)
            voxels.append(np.floor(world / VOXEL_M).astype(np.int32))
    write_table(folder / "bursts.parquet", rows, "bursts")
    ids, counts = np.unique(np.concatenate(voxels), axis=0, return_counts=True)
    static = {
        "origin": np.zeros(3),
        "voxel_size": np.float64(VOXEL_M),
        "ids": ids,
        "counts": counts.astype(np.int32),
    }
    write_arrays(folder / "static_voxels.npz", static, "static_voxels")
    write_frames(folder, START_NS + np.arange(0, 95) * BURST_NS + 3)
    return folder


def write_frames(folder: Path, t_ns: NDArray[np.int64]) -> None:
    nothing = [None] * len(t_ns)
    frames = {
        "frame": np.arange(len(t_ns)),
        "t_ns": t_ns,
        "left_file": [f"camera_left/{t}.jpg" for t in t_ns],
    }
    frames |= dict.fromkeys(("right_file", "right_t_ns", "lidar_front_burst", "lidar_rear_burst"), nothing)
    write_table(folder / "frames.parquet", frames, "frames")


def run(
    folder: Path, out: Path, threads: int = 1, settings: dict[str, float] | None = None, **changes: Any
) -> tuple[dict[str, Any], Any, dict[str, Any]]:
    inputs = {n: folder / f"{n}.parquet" for n in ("bursts", "frames", "trajectory")}
    inputs |= {"calibration": folder / "calibration.json", "static_voxels": folder / "static_voxels.npz"}
    excite(
        recording=folder,
        **inputs | {name: path for name, path in changes.items() if name in inputs},
        wheel_excitation=out / "wheel_excitation.json",
        road_planes=out / "road_planes.parquet",
        report=out / "wheels.report.json",
        settings=default_settings("wheels") | (settings or {}),
        gates=[],
        threads=threads,
    )
    return (
        read_json(out / "wheel_excitation.json", "wheel_excitation")["wheels"],
        read_table(out / "road_planes.parquet", "road_planes"),
        read_json(out / "wheels.report.json", "report"),
    )


@pytest.fixture(scope="module")
def result(
    drive: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict[str, Any], Any, dict[str, Any]]:
    return run(drive, tmp_path_factory.mktemp("out"))


@pytest.mark.parametrize("wheel", WHEELS)
def test_the_road_is_found_under_each_wheel(result: Any, wheel: str) -> None:
    """Bump and slope to a millimetre, forward and in reverse, under a body that sways even while standing."""
    samples = np.array(result[0][wheel]["samples"])
    gap = np.array(result[0][wheel]["gap"])
    assert len(samples) == 1000
    assert gap.mean() < 0.01
    error = np.abs(samples[:, 3] - road(samples[:, 1], samples[:, 2]))
    t = (samples[:, 0] - START_NS) / 1e9
    rolling = np.minimum(np.abs(along(t + 0.05) - along(t)), np.abs(along(t) - along(t - 0.05))) > 0.07
    assert 0.7 < rolling.mean() < 0.9
    assert error[rolling].max() < 1e-3
    assert error.max() < 1.5e-3


def test_the_rotation_is_the_rigs(result: Any) -> None:
    samples = result[0]["rr"]["samples"]
    path = trajectory()
    assert [row[0] for row in samples] == path.t_ns.tolist()
    np.testing.assert_allclose(np.array([row[4:] for row in samples]), path.rotation_wxyz, atol=1e-9)


def test_road_planes_pass_under_the_wheels(drive: Path, result: Any) -> None:
    wheels, table, _ = result
    path = trajectory()
    valid = np.asarray(table["valid"])
    assert valid.mean() > 0.95
    columns = {name: np.asarray(table[name]) for name in table.column_names}
    rows = np.flatnonzero(valid)
    for i in rows[::7]:
        world_from_rig = path.at(columns["t_ns"][i])
        contacts = []
        for wheel in WHEELS:
            nearest = np.argmin(np.abs(path.t_ns - columns["t_ns"][i]))
            contacts.append(wheels[wheel]["samples"][nearest][1:4])
        contacts_rig = apply(inverse(world_from_rig), np.array(contacts))
        pose = {
            "translation_m": [columns[n][i] for n in "xyz"],
            "rotation_wxyz": [columns[f"q{n}"][i] for n in "wxyz"],
        }
        heights = height_above_road(contacts_rig, from_json(pose))
        # The contacts straddle their plane: the heights sum to none and are as large as the residual.
        assert abs(heights.mean()) < 1e-4
        assert np.sqrt(np.mean(heights**2)) == pytest.approx(columns["residual_m"][i], abs=1e-4)
    assert (columns["residual_m"][rows] > 0.01).any()  # one side on the bump


@pytest.mark.parametrize(("setting", "limit"), [("max_plane_residual_m", 0.004), ("max_plane_std_m", 0.0)])
def test_planes_beyond_a_limit_are_not_valid(
    drive: Path, result: Any, tmp_path: Path, setting: str, limit: float
) -> None:
    """One side on the bump leaves a residual; no plane is known exactly."""
    _, table, report = run(drive, tmp_path, settings={setting: limit})
    before, residual = np.asarray(result[1]["valid"]), np.asarray(table["residual_m"])
    within = residual <= limit if setting == "max_plane_residual_m" else np.zeros(len(residual), dtype=bool)
    np.testing.assert_array_equal(np.asarray(table["valid"]), before & within)
    assert np.count_nonzero(before & ~within) > 5
    (share,) = (figure["value"] for figure in report["figures"] if figure["name"] == "plane_valid_pct")
    assert share == pytest.approx(100 * (before & within).mean())


def test_points_outside_the_static_voxels_do_not_count(drive: Path, tmp_path: Path) -> None:
    arrays = read_arrays(drive / "static_voxels.npz", "static_voxels")
    y = arrays["ids"][:, 1] * VOXEL_M
    keep = (y < 18) | (y > 21)
    few = arrays | {"ids": arrays["ids"][keep], "counts": arrays["counts"][keep]}
    write_arrays(tmp_path / "few.npz", few, "static_voxels")
    wheels, table, _ = run(drive, tmp_path, static_voxels=tmp_path / "few.npz")
    for wheel in WHEELS:
        y = np.array(wheels[wheel]["samples"])[:, 2]
        gap = np.array(wheels[wheel]["gap"])
        assert gap[(y > 18.5) & (y < 20.5)].all()
        assert not gap[(y > 8) & (y < 17.7)].any()
    assert not np.asarray(table["valid"])[[55]].any()


def test_a_reach_takes_the_touching_voxels() -> None:
    arrays = {
        "origin": np.array([0.1, 0, 0]),
        "voxel_size": np.array(0.1),
        "ids": np.array([[3, 3, 3], [9, 9, 9]]),
    }
    voxels = StaticVoxels(arrays)
    points = np.array([0.1, 0, 0]) + 0.1 * (
        np.array([[3, 3, 3], [4, 3, 2], [5, 3, 3], [8, 8, 8], [-1, 0, 0]]) + 0.5
    )
    assert voxels.near(points, 0).tolist() == [True, False, False, False, False]
    assert voxels.near(points, 1).tolist() == [True, True, False, True, False]
    assert voxels.near(points, 2).tolist() == [True, True, True, True, False]


@pytest.mark.parametrize("reach", [0, 1, 2])
@pytest.mark.parametrize("count", [0, 200])
def test_compiled_and_plain_static_voxels_are_the_same(reach: int, count: int) -> None:
    rng = np.random.default_rng(reach)
    ids = np.unique(rng.integers(-5, 9, (count, 3)), axis=0)
    voxels = StaticVoxels({"origin": np.array([0.1, 0, 0]), "voxel_size": np.array(0.1), "ids": ids})
    points = rng.uniform(-1, 1.4, (3000, 3))
    found = voxels.near(points, reach)
    np.testing.assert_array_equal(found, voxels.near(points, reach, compiled=False))
    voxel = np.floor((points - [0.1, 0, 0]) / 0.1)
    np.testing.assert_array_equal(found, (np.abs(voxel[:, None] - ids).max(axis=2) <= reach).any(axis=1))
    assert found.any() == (count > 0)


def test_without_points_and_images_there_are_gaps_and_no_planes(drive: Path, tmp_path: Path) -> None:
    none = {
        "origin": np.zeros(3),
        "voxel_size": np.float64(VOXEL_M),
        "ids": np.zeros((0, 3), dtype=np.int32),
        "counts": np.zeros(0, dtype=np.int32),
    }
    write_arrays(tmp_path / "none.npz", none, "static_voxels")
    write_frames(tmp_path, np.zeros(0, dtype=np.int64))
    wheels, table, report = run(
        drive, tmp_path, static_voxels=tmp_path / "none.npz", frames=tmp_path / "frames.parquet"
    )
    assert all(wheels["fl"]["gap"])
    assert set(wheels["fl"]["residual_m"]) == {None}
    assert table.num_rows == 0
    figures = {f["name"]: f["value"] for f in report["figures"]}
    assert figures["gap_pct"] == 100
    assert figures["plane_valid_pct"] is None


def test_a_standing_car_reads_few_bursts(result: Any) -> None:
    counts = result[2]["counts"]
    assert 2 * 99 - 2 * 16 < counts["bursts"] < 2 * 99 - 2 * 10


@pytest.mark.parametrize("when_s", [0.5, 5.0, 9.0])
def test_cropping_loses_no_corridor_point(drive: Path, when_s: float) -> None:
    """What a crop drops lies outside the corridor once it is in the world."""
    path = trajectory()
    bundle = read_json(drive / "calibration.json", "calibration")
    paths = [contact_path(path, bundle["wheels"][wheel]["contact_m"], 0.05) for wheel in WHEELS]
    for name in ("lidar_front", "lidar_rear"):
        rig_from_lidar = from_json(bundle["extrinsics"][f"rig_from_{name}"])
        burst = read_burst(drive / name / f"{START_NS + round(when_s * 1e9)}.laz")
        windows = [(-1.0, 100.0)] * 4
        cropped = crop_burst(burst, rig_from_lidar, path, [Track.of(wheel) for wheel in paths], windows)
        kept = {tuple(point) for point in cropped.points}
        lost = np.array([tuple(point) not in kept for point in burst.points])
        assert 0.1 < lost.mean() < 0.99
        world = deskew_burst(burst, rig_from_lidar, path)[lost]
        for wheel in paths:
            distance = np.abs(world[:, None, :2] - wheel.knot_position[None, ::2, :2])
            assert np.linalg.norm(distance, axis=2).min() > 0.13


def out_of_trajectory(folder: Path, out: Path) -> dict[str, Path]:
    table = read_table(folder / "trajectory.parquet", "trajectory").slice(0, 500)
    write_table(out / "short.parquet", table, "trajectory")
    return {"trajectory": out / "short.parquet"}


def missing_voxels(folder: Path, out: Path) -> dict[str, Path]:
    return {"static_voxels": out / "nowhere.npz"}


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (out_of_trajectory, r"trajectory does not cover a requested time|poses do not cover the burst"),
        (missing_voxels, r"nowhere.npz: file is missing"),
    ],
)
def test_inputs_that_do_not_fit_are_refused(
    drive: Path, tmp_path: Path, spoil: Callable[[Path, Path], dict[str, Path]], message: str
) -> None:
    with pytest.raises(CardError, match=message):
        run(drive, tmp_path, **spoil(drive, tmp_path))
    assert not (tmp_path / "wheel_excitation.json").exists()


def test_same_input_same_bytes_on_any_number_of_processes(drive: Path, result: Any, tmp_path: Path) -> None:
    again = run(drive, tmp_path, threads=2)
    assert again[0] == result[0]
    assert again[1].equals(result[1])
    assert again[2] == result[2]
