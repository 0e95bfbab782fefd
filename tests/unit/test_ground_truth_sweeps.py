import numpy as np
import pytest
import yaml
from ground_truth_scene import RIG_FROM, calibration, straight, write_drive

from card.artifacts import default_settings
from card.geometry import apply
from card.ground_truth import sweeps
from card.ground_truth.sweeps import Drive
from card.recording.laz import read_burst

WALL = (np.array([4.0, -20, -2]), np.array([5.0, 70, 3.0]))


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    return write_drive(folder, bursts=4, columns=60, speed=12.0, boxes=lambda t: [WALL], frames=[0.1])


def opened(inputs, **settings) -> Drive:
    filled = default_settings("ground_truth") | settings
    return Drive(inputs["recording"], inputs["bursts"], calibration(), straight(0.4, 12.0), filled)


def test_bursts_come_in_the_fixed_order(inputs):
    drive = opened(inputs)
    assert drive.index.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    # The scene's rear sweep ends a little earlier or later: time decides first, then the front LiDAR.
    keys = list(zip(drive.end_ns.tolist(), (~drive.front).tolist(), drive.index.tolist(), strict=True))
    assert keys == sorted(keys)


def test_every_point_is_placed_with_the_pose_of_its_own_time(inputs):
    drive = opened(inputs, front_crop="none")
    trajectory = straight(0.4, 12.0)
    for i in range(len(drive)):
        burst = read_burst(drive.files[i])
        poses = trajectory.at(burst.time_ns) @ RIG_FROM[drive.sensor(i)]
        assert np.allclose(drive.sweep(i).points, apply(poses, burst.points), atol=1e-9)
        end = trajectory.at(burst.end_ns) @ RIG_FROM[drive.sensor(i)]
        assert np.allclose(drive.origins[i], end[:3, 3])


def test_a_recording_that_is_deskewed_gets_the_pose_of_the_burst_s_end(inputs, tmp_path):
    recording = tmp_path / "recording"
    recording.mkdir()
    document = yaml.safe_load((inputs["recording"] / "recording.yaml").read_text())
    for lidar in document["sensors"]:
        document["sensors"][lidar] = {**document["sensors"][lidar], "deskewed": True}
        (recording / lidar).symlink_to(inputs["recording"] / lidar)
    (recording / "recording.yaml").write_text(yaml.safe_dump(document))
    drive = opened(inputs | {"recording": recording})
    for i in range(len(drive)):
        burst = read_burst(drive.files[i])
        keep = burst.points[:, 1] >= 0 if drive.front[i] else np.ones(len(burst), bool)
        end = straight(0.4, 12.0).at(drive.end_ns[i]) @ RIG_FROM[drive.sensor(i)]
        assert np.allclose(drive.sweep(i).points, apply(end, burst.points[keep]), atol=1e-9)


@pytest.mark.parametrize(
    ("settings", "front", "rear"),
    [
        ({}, "forward", "all"),
        ({"front_crop": "none"}, "all", "all"),
        ({"rear_crop": "rear_half"}, "forward", "backward"),
    ],
)
def test_crops_in_the_car_s_terms(inputs, settings, front, rear):
    drive = opened(inputs, **settings)
    for i in range(len(drive)):
        sweep = drive.sweep(i)
        ahead = sweep.points[:, 1] - drive.poses(i, sweep.time_ns)[:, 1, 3]
        wanted = front if drive.front[i] else rear
        if wanted == "forward":
            assert ahead.min() >= -1e-9
        elif wanted == "backward":
            assert ahead.max() <= 1e-9
        else:
            assert ahead.min() < 0 < ahead.max()
        assert (sweep.cropped == 0) == (wanted == "all")


def test_the_cache_is_bounded_and_changes_nothing(inputs, monkeypatch):
    whole = opened(inputs)
    expected = [whole.sweep(i).points for i in range(len(whole))]
    monkeypatch.setattr(sweeps, "CACHE_POINTS", 2000)
    small = opened(inputs)
    for _ in range(2):
        for i, points in enumerate(expected):
            assert np.array_equal(small.sweep(i).points, points)
            held = sum(len(sweep.points) for sweep in small._cache.values())
            assert held <= max(2000, len(points))


def test_while_frames_go_by_only_sweeps_of_the_front_lidar_are_kept(inputs):
    drive = opened(inputs)
    drive.keep(2000)
    for i in range(len(drive)):
        drive.sweep(i)
    assert all(drive.front[i] for i in drive._cache)
    assert next(reversed(drive._cache)) == drive.of(True)[-1]
    assert sum(len(sweep.points) for sweep in drive._cache.values()) <= 2000
