"""Delivered trajectory files and their re-anchoring."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from card.errors import CardError
from card.poses.anchor import anchor, tilt_deg, up_vector
from card.poses.delivered import read_kitti, read_tum

GOOD = [
    "# t x y z qx qy qz qw",
    "1776153600.000000001 1 2 3 0 0 0.6 0.8",
    "1776153600.100000002 1 3 3 0 0 0 1",
]


def write(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


def test_tum_keeps_nanoseconds_and_the_quaternion_order(tmp_path: Path) -> None:
    t_ns, poses = read_tum(write(tmp_path / "t.tum", GOOD), 1e-3)
    assert t_ns.tolist() == [1776153600000000001, 1776153600100000002]
    np.testing.assert_allclose(poses[0, :3, :3], Rotation.from_quat([0, 0, 0.6, 0.8]).as_matrix(), atol=1e-15)
    np.testing.assert_array_equal(poses[0, :3, 3], [1, 2, 3])


def test_kitti_agrees_with_tum(tmp_path: Path) -> None:
    t_tum, tum = read_tum(write(tmp_path / "t.tum", GOOD), 1e-3)
    rows = [" ".join(f"{v!r}" for v in pose[:3].ravel().tolist()) for pose in tum]
    stamps = [line.split()[0] for line in GOOD[1:]]
    t_kitti, kitti = read_kitti(write(tmp_path / "k.txt", rows), write(tmp_path / "times.txt", stamps), 1e-3)
    np.testing.assert_array_equal(t_kitti, t_tum)
    np.testing.assert_array_equal(kitti, tum)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1776153600.1 1 3 3 0 0 1", "t.tum:3: wrong number of columns.*found 7, wanted 8"),
        ("1776153600.1 1 3 3 0 0 0 1.1", "t.tum:3: no unit quaternion.*found 1.1000"),
        ("1776153600.000000001 1 3 3 0 0 0 1", "t.tum:3: times do not increase"),
        ("1776153600.1 1 3 nan 0 0 0 1", "t.tum:3: number is not finite"),
        ("1776153600.1 1 3 x 0 0 0 1", "t.tum:3: not a number"),
        ("soon 1 3 3 0 0 0 1", "t.tum:3: not a time.*found soon"),
        ("# nothing", "t.tum: too few lines"),
    ],
)
def test_a_bad_tum_line_is_named(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(CardError, match=message):
        read_tum(write(tmp_path / "t.tum", [*GOOD[:2], line]), 1e-3)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(CardError, match=r"trajectory file is missing"):
        read_tum(tmp_path / "t.tum", 1e-3)


def test_kitti_wants_a_time_a_pose_and_rotations(tmp_path: Path) -> None:
    identity = "1 0 0 0 0 1 0 0 0 0 1 0"
    mirror = "1 0 0 0 0 1 0 0 0 0 -1 0"
    times = write(tmp_path / "times.txt", ["0.0", "0.1"])
    with pytest.raises(CardError, match=r"as many times as poses.*found 2, wanted 3"):
        read_kitti(write(tmp_path / "k.txt", [identity] * 3), times, 1e-3)
    with pytest.raises(CardError, match=r"k.txt:2: no rotation"):
        read_kitti(write(tmp_path / "k.txt", [identity, mirror]), times, 1e-3)


@pytest.mark.parametrize("axis", ["z", "-y", "x"])
def test_anchoring_keeps_motion_and_tilt_and_faces_forward(axis: str) -> None:
    rng = np.random.default_rng(4)
    up = up_vector(axis)
    # A car on a slope: its z leans 5 degrees from up, about a random horizontal axis.
    level, _ = Rotation.align_vectors([up], [[0, 0, 1]])
    poses = np.tile(np.eye(4), (6, 1, 1))
    heading = Rotation.from_rotvec(np.outer(np.linspace(2.0, 2.6, 6), up))
    poses[:, :3, :3] = (heading * level * Rotation.from_euler("xy", [4, 3], degrees=True)).as_matrix()
    poses[:, :3, 3] = rng.normal(0, 50, 3) + rng.normal(0, 1, (6, 3))

    world = anchor(poses, up)
    np.testing.assert_allclose(world[0, :3, 3], 0, atol=1e-12)
    assert abs(world[0, 0, 1]) < 1e-12  # forward has no part to the right
    assert world[0, 1, 1] > 0.9
    np.testing.assert_allclose(tilt_deg(world, np.array([0, 0, 1.0])), tilt_deg(poses, up), atol=1e-9)
    np.testing.assert_allclose(np.linalg.inv(world[0]) @ world, np.linalg.inv(poses[0]) @ poses, atol=1e-9)
    np.testing.assert_allclose(world[:, 2, 3], (poses[:, :3, 3] - poses[0, :3, 3]) @ up, atol=1e-9)
