import json
from itertools import count

import numpy as np
import pyarrow.parquet as pq
import pytest
from ground_truth_scene import GROUND_Z, RIG_FROM, START_NS, calibration, straight, write_drive, write_mask

from card.artifacts import default_settings, inventory, read_arrays, read_table, write_table
from card.errors import CardError
from card.geometry import apply
from card.ground_truth.aggregate import aggregate
from card.ground_truth.sweeps import Drive

SPEED = 5.0
FRAMES = [1.0, 1.3]
WALL = (np.array([4.0, -20, -2]), np.array([5.0, 70, 3.0]))


def boxes_at(t: float):
    """A wall along the road and a car that drives ahead, a little slower than the rig."""
    return [WALL, car_at(t)]


def car_at(t: float):
    y = 9.0 + 4.0 * t
    return np.array([-1.0, y, GROUND_Z]), np.array([1.0, y + 4, 0.3])


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    inputs = write_drive(folder, bursts=60, columns=96, speed=SPEED, boxes=boxes_at, frames=FRAMES)
    return folder, inputs


@pytest.fixture(scope="module")
def run(drive):
    folder, inputs = drive
    numbers = count()

    def run(threads=1, gates=(), **settings):
        out = folder / f"run-{next(numbers)}" / "ground_truth"
        report = out.with_name("ground_truth.report.json")
        aggregate(
            **inputs,
            out=out,
            report=report,
            # A camera of 200 pixels tells few points apart.
            settings=default_settings("ground_truth") | {"pixels_per_point": 0} | settings,
            gates=gates,
            threads=threads,
        )
        return out, json.loads(report.read_text())

    return run


@pytest.fixture(scope="module")
def default(run):
    gate = {"figure": "points_per_frame", "unit": "1", "better": "higher", "threshold": 500}
    return run(gates=[gate, gate | {"figure": "window_coverage_pct", "unit": "%", "threshold": 90}])


def world_points(out, frame: int) -> np.ndarray:
    points = read_arrays(out / f"{frame:06d}.npz", "ground_truth_points")["points"].astype(np.float64)
    world_from_rig = straight(6.0, SPEED).at(START_NS + round(FRAMES[frame] * 1e9))
    return apply(world_from_rig @ RIG_FROM["camera_left"], points)


def on_road(points: np.ndarray) -> np.ndarray:
    return np.abs(points[:, 2] - GROUND_Z) < 0.06


def inside_swept_car(points: np.ndarray, t: float) -> np.ndarray:
    """Points well above the road where the car passed, at any time but that of the keyframe.

    Where the car stood in the last half second nothing looked again: that is not asked for.
    """
    y = 4.0 * (t + 0.05)
    above = (np.abs(points[:, 0]) < 1.1) & (points[:, 2] > GROUND_Z + 0.3) & (points[:, 2] < 0.4)
    return above & ((points[:, 1] < 8.5 + y) | (points[:, 1] > 13.5 + y)) & (points[:, 1] < 30)


def test_moving_car_vanishes_and_the_road_stays(default):
    out, _ = default
    for frame, t in enumerate(FRAMES):
        points = world_points(out, frame)
        # What is hidden behind the car when nothing looks again: the method's own share is 0.05 to 0.16 %.
        assert inside_swept_car(points, t).mean() < 5e-4
        road = points[on_road(points) & (np.abs(points[:, 0]) < 2)]
        # Road the car was on before the image, and the road right ahead of the rig.
        ahead = road[:, 1] - SPEED * t
        assert (ahead < 9).sum() > 100
        wall = np.abs(points[:, 0] - 4.0) < 0.06
        assert wall.sum() > 300
        beside = road[np.abs(road[:, 0]) > 1.2]
        assert np.abs(beside[:, 2] - GROUND_Z).max() < 0.03
        assert (on_road(points) | wall | (np.abs(points[:, 0]) < 1.1)).mean() > 0.98


def test_methods_differ_and_only_visibility_keeps_the_road(run, default):
    counts = {"visibility": default[1]["counts"]["voxels_static"]}
    road = {}
    for method in ("literal", "off"):
        out, report = run(flow_method=method)
        counts[method] = report["counts"]["voxels_static"]
        road[method] = on_road(world_points(out, 1)).sum()
    road["visibility"] = on_road(world_points(default[0], 1)).sum()
    assert counts["literal"] < counts["off"] < counts["visibility"]
    assert road["literal"] < road["visibility"]


def test_bytes_do_not_depend_on_threads(run, default):
    out, _ = run(threads=2)
    assert inventory(out) == inventory(default[0])


def test_bytes_do_not_depend_on_blocks_of_frames(run, default, monkeypatch):
    monkeypatch.setattr("card.ground_truth.aggregate.BLOCK_FRAMES", 1)
    out, _ = run()
    assert inventory(out) == inventory(default[0])


def test_the_folder_is_whole_and_describes_itself(default):
    out, report = default
    table = read_table(out / "inventory.parquet", "inventory")
    names = ["000000.npz", "000001.npz", "coverage.parquet", "static_voxels.npz"]
    assert table["name"].to_pylist() == names
    static = read_arrays(out / "static_voxels.npz", "static_voxels")
    ids = static["ids"].astype(np.int64)
    assert np.array_equal(ids, ids[np.lexsort(ids.T[::-1])])
    assert len(ids) == report["counts"]["voxels_static"]
    corners = ids * static["voxel_size"] + static["origin"]
    assert (np.abs(corners[:, 2] + 0.05 - GROUND_Z) < 0.11).sum() > 1000


def test_saved_points_are_on_the_grid_in_raster_order_and_in_the_image(default):
    points = read_arrays(default[0] / "000000.npz", "ground_truth_points")["points"]
    assert np.array_equal(points * 4096, np.rint(points * 4096))
    rows = np.rint(points[:, 1] / points[:, 2] * 120 + 79.5)
    # The distortion is weak: undistorted rows are sorted within a few pixels.
    assert (np.diff(rows) > -12).all()
    assert rows.max() < 144
    assert points[:, 2].min() >= 0.3


def test_report_and_coverage(default):
    out, report = default
    rows = pq.read_table(out / "coverage.parquet").to_pylist()
    assert [row["flag"] for row in rows] == ["cut", "cut"]
    first = rows[0]
    assert first["front_wanted_start_ns"] == START_NS - 2_000_000_000
    assert first["front_wanted_end_ns"] == START_NS + 14_000_000_000
    assert first["front_present_start_ns"] == START_NS
    assert first["front_bursts"] == 60
    assert first["front_share"] == pytest.approx(6 / 16, abs=0.01)
    assert first["rear_share"] == pytest.approx(5 / 30, abs=0.01)
    assert first["window_share"] == pytest.approx(11 / 46, abs=0.01)
    steps = [first[name] for name in first if name.startswith("points_") and name != "points_keyframe"]
    before_keyframe = steps[: steps.index(first["points_pass_1"]) + 1]
    assert before_keyframe == sorted(before_keyframe, reverse=True)
    figures = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert figures["points_per_frame"] == np.median([row["points_saved"] for row in rows])
    assert figures["flagged_frames_pct"] == 100
    assert [gate["verdict"] for gate in report["gates"]] == ["pass", "fail"]
    assert report["sequence"] == "scene"
    assert "the rigidity test rejected no voxel" in report["notes"]


def test_points_at_the_sensor_are_dropped_and_counted(drive, default):
    # The scene has no such return: everything nearer than 4 m serves as one.
    _, inputs = drive
    settings = default_settings("ground_truth") | {"min_range_m": 4.0}
    opened = Drive(inputs["recording"], inputs["bursts"], calibration(), straight(6.0, SPEED), settings)
    sweeps = [opened.sweep(i) for i in range(len(opened))]
    dropped = sum(sweep.at_origin for sweep in sweeps)
    assert dropped > 0
    counts = default[1]["counts"]
    kept = sum(len(sweep.points) + sweep.cropped for sweep in sweeps)
    assert kept + dropped == counts["points"] + counts["points_cropped"]
    assert counts["points_at_sensor_origin"] == 0


def altered(drive, tmp_path, name, change):
    _, inputs = drive
    table = pq.read_table(inputs[name])
    write_table(tmp_path / f"{name}.parquet", change(table), name)
    return inputs | {name: tmp_path / f"{name}.parquet"}


def attempt(inputs, tmp_path, **settings):
    aggregate(
        **inputs,
        out=tmp_path / "out",
        report=tmp_path / "report.json",
        settings=default_settings("ground_truth") | settings,
        gates=[],
        threads=1,
    )


def test_poses_that_do_not_cover_a_burst(drive, tmp_path):
    inputs = altered(drive, tmp_path, "trajectory", lambda table: table.slice(0, 500))
    with pytest.raises(CardError, match="poses do not cover 42 bursts"):
        attempt(inputs, tmp_path)
    assert not (tmp_path / "out").exists()


def test_poses_that_do_not_cover_an_image(drive, tmp_path):
    def late(table):
        return table.set_column(1, "t_ns", [[START_NS, START_NS + 10**12]])

    inputs = altered(drive, tmp_path, "frames", late)
    with pytest.raises(CardError, match="frame 1: poses do not cover the image"):
        attempt(inputs, tmp_path)


def test_a_burst_that_comes_twice(drive, tmp_path):
    def twice(table):
        times = table["t_start_ns"].to_numpy().copy()
        times[3] = times[2]
        return table.set_column(2, "t_start_ns", [times])

    inputs = altered(drive, tmp_path, "bursts", twice)
    with pytest.raises(CardError, match="two bursts start at the same time"):
        attempt(inputs, tmp_path)


def test_a_burst_within_another(drive, tmp_path):
    def stretched(table):
        ends = table["t_end_ns"].to_numpy().copy()
        ends[3] = ends[5] + 1
        return table.set_column(3, "t_end_ns", [ends])

    inputs = altered(drive, tmp_path, "bursts", stretched)
    with pytest.raises(CardError, match="lies within another"):
        attempt(inputs, tmp_path)


def test_a_wrong_ego_mask(drive, tmp_path):
    write_mask(tmp_path / "mask.png", 100, 100)
    with pytest.raises(CardError, match="ego mask of the wrong size"):
        attempt(drive[1] | {"ego_mask": tmp_path / "mask.png"}, tmp_path)


@pytest.mark.parametrize(("lidar", "flag"), [("lidar_front", "no_rear"), ("lidar_rear", "no_front")])
def test_a_missing_lidar_flags_the_frames(drive, tmp_path, lidar, flag):
    inputs = altered(drive, tmp_path, "bursts", lambda t: t.filter(np.array(t["lidar"].to_pylist()) == lidar))
    if flag == "no_front":
        inputs |= altered(
            drive, tmp_path, "frames", lambda t: t.set_column(5, "lidar_front_burst", [[None, None]])
        ) | {"bursts": inputs["bursts"]}
    attempt(inputs, tmp_path)
    rows = pq.read_table(tmp_path / "out" / "coverage.parquet").to_pylist()
    assert [row["flag"] for row in rows] == [flag, flag]
    assert all(row["points_static"] == 0 for row in rows)
    # Without the rear LiDAR nothing is static: what is left is the visible part of the keyframe.
    assert all((row["points_saved"] > 0) == (flag == "no_rear") for row in rows)
    assert all(row["points_saved"] <= row["points_keyframe"] for row in rows)


def test_the_consensus_rejects_and_says_how_many(run, drive, default):
    folder, _ = drive
    maps = folder / "maps" / "scene"
    maps.mkdir(parents=True, exist_ok=True)
    for frame in range(len(FRAMES)):
        # A depth of which the wall is far too near, and the road somewhere between.
        np.save(maps / f"{frame:06d}.npy", np.full((160, 200), 5.0, np.float32))
    consensus = default_settings("ground_truth")["consensus"] | {"sequences": ["scene"]}
    _, report = run(consensus=consensus | {"depth_maps": str(maps.parent)})
    before = default[1]["counts"]
    rejected = report["counts"]["points_rejected"]
    assert 0 < rejected < before["points_saved"]
    assert before["points_saved"] - rejected <= report["counts"]["points_saved"] < before["points_saved"]
    assert report["counts"]["points_pass_2"] == before["points_pass_2"]
    assert f"{rejected} points inconsistent with the monocular depth" in report["notes"]
    with pytest.raises(CardError, match="consensus without a depth"):
        run(consensus=consensus)
    with pytest.raises(CardError, match="consensus without anonymized images"):
        run(consensus=consensus | {"model": "m.onnx"})
