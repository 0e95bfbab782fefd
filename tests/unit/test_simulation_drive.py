"""A whole drive at the smallest scale: complete, repeatable, new with each seed, truthful in its labels."""

import csv
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from card.artifacts import inventory, read_arrays, read_table, read_yaml
from card.errors import CardError
from card.estimation.deskew import deskew_burst
from card.geometry import Trajectory
from card.recording.laz import read_burst
from card.recording.paths import list_bursts, list_images, stamp_of
from card.simulation.bodies import HEADLIGHTS_M
from card.simulation.centreline import circuit
from card.simulation.drives import DRIVES, drive_named
from card.simulation.labels import outline, road_boxes
from card.simulation.raycast import Tracer
from card.simulation.scales import scale_named
from card.simulation.session_drive import write_session_drive
from card.simulation.simulate import simulate_drive
from card.simulation.surfaces import Surface
from card.simulation.vehicle import course
from card.simulation.world import World, build_world

DRIVE = "de_town_bumps"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("drive")
    simulate_drive(DRIVE, recording=root / "recording", truth=root / "truth", scale="tiny", seed=5)
    return root


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(DRIVE, "tiny", 5)


def test_raw_layout_is_complete(folder: Path) -> None:
    recording = folder / "recording"
    description = read_yaml(recording / "recording.yaml", "recording")
    assert (description["id"], description["day"], description["country"]) == (DRIVE, "2026-04-14", "DE")
    left, right = (list_images(recording, name) for name in ("camera_left", "camera_right"))
    assert len(left) == len(right) == 5
    assert all(0 < stamp_of(r) - stamp_of(a) < 1_000_000 for a, r in zip(left, right, strict=True))
    assert Image.open(left[0]).size == (140, 140)
    assert len(list_bursts(recording, "lidar_front")) >= 58
    imu = read_table(recording / "imu.parquet", "imu")
    assert imu.num_rows == 1201
    assert (recording / "trajectory.tum").is_file()
    assert (recording / "annotations" / "classes.txt").read_text() == "positive\nnegative\n"
    reviewed = {p.stem for p in (recording / "annotations" / "labels").iterdir()}
    assert reviewed < {p.stem for p in left}  # some were not looked at
    with (recording / "privacy_labels.csv").open() as lines:
        assert next(csv.reader(lines)) == ["camera", "t_ns", "kind", "x_min", "y_min", "x_max", "y_max"]


def test_points_lie_on_the_true_mesh_at_their_own_time(folder: Path, world: World) -> None:
    truth = Trajectory.from_table(read_table(folder / "truth" / "trajectory.parquet", "trajectory"))
    np.testing.assert_allclose(truth.translation_m[0], 0, atol=1e-9)
    assert abs(truth.at(truth.start_ns)[0, 1]) < 1e-9  # no yaw at the start
    static = Tracer(world.static, []).static
    corrections = {
        name: getattr(world.rig.lidar_corrections["lidar_front"], name)
        for name in (
            "range_offset_m",
            "channel_range_offset_m",
            "channel_elevation_offset_rad",
            "channel_azimuth_offset_rad",
        )
    }
    for path in list_bursts(folder / "recording", "lidar_front")[10:50:13]:
        burst = read_burst(path)
        met = read_arrays(folder / "truth" / "bursts" / "lidar_front" / f"{path.stem}.npz", "truth_burst")
        assert len(met["surface"]) == len(burst)
        points = deskew_burst(burst, world.rig.rig_from["lidar_front"], truth, corrections)
        still = points[~met["dynamic"]]
        away = static.distance(still)
        assert np.quantile(away, 0.99) < 0.02
        assert np.median(away) < 0.006


def test_label_boxes_lie_on_the_feature(folder: Path, world: World) -> None:
    table = read_table(folder / "truth" / "boxes.parquet", "truth_boxes").to_pylist()
    rows = [r for r in table if r["camera"] == "camera_left" and r["kind"] in ("positive", "negative")]
    assert rows
    camera, pose = world.rig.cameras["camera_left"], world.rig.rig_from["camera_left"]
    for row in rows:
        thing = world.road.irregularities[row["thing"]]
        from_world = np.linalg.inv(world.path.at(row["t_ns"]) @ pose)
        points = outline(world.road, thing) @ from_world[:3, :3].T + from_world[:3, 3]
        u, v = camera.project(points[points[:, 2] > 2]).T
        # In sight is at most the whole of it; a pixel more at each edge is what rounding may do.
        assert u.min() - 1.5 <= row["x_min"] < row["x_max"] <= u.max() + 1.5
        assert v.min() - 1.5 <= row["y_min"] < row["y_max"] <= v.max() + 1.5
        assert 0 < row["share"] <= 1


def test_frames_and_movers_say_what_moved_the_points(folder: Path, world: World) -> None:
    frames = read_table(folder / "truth" / "frames.parquet", "truth_frames")
    movers = read_table(folder / "truth" / "movers.parquet", "truth_movers")
    images = {stamp_of(path) for path in list_images(folder / "recording", "camera_left")}
    assert images <= set(frames["t_ns"].to_pylist())
    assert movers.num_rows == frames.num_rows * (len(world.cars) + len(world.walkers))
    # The road lies the rig's height below it, and nearly level.
    assert np.abs(np.asarray(frames["offset_m"]) - 1.7).max() < 0.08
    assert np.asarray(frames["normal_z"]).min() > 0.99
    rows = [row for row in movers.to_pylist() if row["kind"] == "car"]
    path = list_bursts(folder / "recording", "lidar_front")[30]
    truth = read_arrays(folder / "truth" / "bursts" / "lidar_front" / f"{path.stem}.npz", "truth_burst")
    pose = world.path.at(stamp_of(path) + 50_000_000) @ world.rig.rig_from["lidar_front"]
    points = read_burst(path).points @ pose[:3, :3].T + pose[:3, 3]
    body = np.isin(truth["surface"], (Surface.CAR_BODY, Surface.CAR_GLASS)) & truth["dynamic"]
    now = [r for r in rows if abs(r["t_ns"] - stamp_of(path) - 50_000_000) < 60_000_000]
    middles = np.array([[r["x"], r["y"]] for r in now])
    if body.any():
        gap = np.linalg.norm(points[body, None, :2] - middles, axis=2).min(axis=1)
        assert gap.max() < 3.5


def test_yolo_files_say_what_the_truth_says(folder: Path) -> None:
    table = read_table(folder / "truth" / "boxes.parquet", "truth_boxes").to_pylist()
    for path in (folder / "recording" / "annotations" / "labels").iterdir():
        boxes = [
            r
            for r in table
            if r["camera"] == "camera_left"
            and r["t_ns"] == int(path.stem)
            and r["kind"] in ("positive", "negative")
        ]
        lines = [line.split() for line in path.read_text().splitlines()]
        assert len(lines) == len(boxes)
        for (kind, *values), box in zip(lines, boxes, strict=True):
            x, y, w, h = np.array(values, float) * 140
            assert kind == ("0" if box["kind"] == "positive" else "1")
            edges = [x - w / 2 - 0.5, y - h / 2 - 0.5, x + w / 2 - 0.5, y + h / 2 - 0.5]
            np.testing.assert_allclose(
                edges, [box[k] for k in ("x_min", "y_min", "x_max", "y_max")], atol=1e-3
            )


def test_hidden_features_get_no_box(world: World) -> None:
    camera = world.rig.cameras["camera_left"]
    nothing = np.full((camera.height, camera.width), -1, np.int32)
    assert road_boxes(nothing, world.road) == []


def test_same_seed_same_bytes_by_however_many_processes(folder: Path, tmp_path: Path) -> None:
    simulate_drive(DRIVE, recording=tmp_path / "r", truth=tmp_path / "t", scale="tiny", seed=5, threads=2)
    assert _hashes(tmp_path / "r") == _hashes(folder / "recording")
    assert _hashes(tmp_path / "t") == _hashes(folder / "truth")


def test_another_seed_makes_another_world(world: World) -> None:
    other = build_world(DRIVE, "tiny", 6)
    s = np.linspace(0, 30, 50)
    assert np.abs(world.road.xyz(s, 1.0) - other.road.xyz(s, 1.0)).max() > 0.05
    assert world.static.vertices.shape != other.static.vertices.shape
    assert not np.allclose(world.sun, other.sun)


def test_a_session_s_drive_without_others_on_the_road_has_its_truth(tmp_path: Path) -> None:
    write_session_drive(
        "2026-04-14-mid", folder=tmp_path / "drive", truth=tmp_path / "truth", scale="tiny", seed=5
    )
    assert read_table(tmp_path / "truth" / "movers.parquet", "truth_movers").num_rows == 0
    assert read_table(tmp_path / "truth" / "frames.parquet", "truth_frames").num_rows == 6


def test_unknown_drive_or_scale(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"unknown simulated drive.*de_town_bumps"):
        simulate_drive("xx", recording=tmp_path / "r", truth=tmp_path / "t", scale="tiny", seed=1)
    with pytest.raises(CardError, match="unknown scale"):
        simulate_drive(DRIVE, recording=tmp_path / "r", truth=tmp_path / "t", scale="huge", seed=1)
    assert list(tmp_path.iterdir()) == []


def test_the_five_drives_are_what_the_demo_promises() -> None:
    assert [d.country for d in DRIVES.values()] == ["DE", "DE", "DE", "IT", "IT"]
    assert [name for name, d in DRIVES.items() if d.bag] == ["de_gravel_offroad"]
    assert [name for name, d in DRIVES.items() if d.circuit] == ["it_town_revisit"]
    assert any(v == 0 for _, v in DRIVES["de_town_bumps"].speeds)
    assert [name for name, d in DRIVES.items() if d.night] == ["it_zero_shot"]


def test_the_demo_s_sheet_knows_which_drives_are_at_night() -> None:
    with (Path(__file__).parents[2] / "config" / "sequences.tsv").open() as lines:
        light = {row["id"]: row["light"] for row in csv.DictReader(lines, delimiter="\t")}
    assert {name: "night" if d.night else "day" for name, d in DRIVES.items()} == light


def test_the_loop_is_600_m_driven_once_and_a_little_more() -> None:
    drive = drive_named("it_town_loop")
    assert drive.circuit is not None
    length = circuit(*drive.circuit).length
    assert length == pytest.approx(600, abs=5)
    size = scale_named("full").cut(drive.lasts_s)
    trip = course([(t + size.camera_start_s, v) for t, v in drive.speeds], 0.0, size.duration_s)
    assert 1.05 * length < trip.at(size.duration_s) < 1.3 * length
    assert 60 <= size.duration_s <= 80
    speed = np.diff(trip.s) / np.diff(trip.t)
    assert 8 <= speed.min() <= speed.max() <= 10 + 1e-6


def test_cars_carry_their_headlights_where_their_mesh_has_lamps(world: World) -> None:
    assert len(world.cars) >= 2
    for index in world.cars:
        body = world.movers[index].mesh
        lamps = body.vertices[np.unique(body.triangles[body.surface == Surface.LAMP])]
        for place in HEADLIGHTS_M:
            assert np.linalg.norm(lamps - place, axis=1).min() < 0.2
    assert len(world.lamps) > 3
    street = world.static.vertices[np.unique(world.static.triangles[world.static.surface == Surface.LAMP])]
    gap = np.linalg.norm(world.lamps[:, None] - street, axis=2).min(axis=1)
    assert gap.max() < 0.3


def _hashes(root: Path) -> dict[str, str]:
    table = inventory(root)
    return dict(zip(table["name"], table["sha256"], strict=True))
