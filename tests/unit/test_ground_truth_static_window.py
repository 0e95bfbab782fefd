from types import SimpleNamespace

import numpy as np
import pytest
from ground_truth_scene import calibration, write_mask
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from card.artifacts import default_settings
from card.geometry import transform
from card.ground_truth.left_camera import LeftCamera
from card.ground_truth.reference.selection import select
from card.ground_truth.reference.static_cloud import static_cloud
from card.ground_truth.static_set import StaticSet
from card.ground_truth.static_window import StaticWindow
from card.ground_truth.voxels import VoxelGrid

SIZE = 0.1
ORIGINS = [(0.0, 0.0, 0.0), (-3.05, -812.3, -41.7), (6012.3, -5987.1, 103.0)]


class Bursts:
    """Bursts of points scattered about a few places in front of the camera, as a drive gives them."""

    def __init__(self, seed, origin, lidars, count=36, noise=0.03):
        rng = np.random.default_rng(seed)
        places = rng.uniform((-6, -2, -2), (6, 14, 2), (150, 3)) + origin
        self.front = np.array([lidars[i % len(lidars)] for i in range(count)])
        sizes = rng.integers(0, 400, count) * (rng.random(count) > 0.1)
        self._points = [places[rng.integers(0, len(places), n)] + rng.normal(0, noise, (n, 3)) for n in sizes]

    def sweep(self, i):
        return SimpleNamespace(points=self._points[i])


def static_of(drive, origin, seed):
    """Two thirds of the voxels that were hit are static."""
    grid = VoxelGrid(SIZE, tuple(int(c) for c in np.floor((np.array(origin) - 100) / SIZE)))
    keys = np.unique(grid.keys(np.concatenate(drive._points)))
    keys = keys[np.random.default_rng(seed).random(len(keys)) < 2 / 3]
    return StaticSet(grid, keys, np.ones(len(keys), np.int32), {})


@pytest.fixture(scope="module")
def camera(tmp_path_factory):
    mask = tmp_path_factory.mktemp("mask") / "mask.png"
    write_mask(mask)
    return LeftCamera(calibration(), mask)


def windows(drive, frames, front, rear):
    """Bursts of frames, one frame a burst: spans of each LiDAR relative to the frame's number."""
    wanted = []
    for k in range(frames):
        i = np.arange(len(drive.front))
        inside = np.where(
            drive.front, (i >= k + front[0]) & (i < k + front[1]), (i >= k + rear[0]) & (i < k + rear[1])
        )
        wanted.append(np.flatnonzero(inside))
    return wanted


def compare(drive, static, camera, wanted, poses, settings, block):
    window = StaticWindow(drive, static, camera, settings)
    sizes = []
    for start in range(0, len(wanted), block):
        part = wanted[start : start + block]
        window.open(np.unique(np.concatenate(part)))
        for bursts, pose in zip(part, poses[start:], strict=False):
            key = int(bursts[-1]) if len(bursts) else -1
            fast = window.select(bursts, key, pose)
            plain = select(static_cloud(drive, static, bursts), key, pose, static, camera, settings)
            assert fast.counts == plain.counts
            assert fast.diameter == plain.diameter
            rows = [np.c_[found.points, found.of_keyframe] for found in (fast, plain)]
            first, second = (found[np.lexsort(found.T)] for found in rows)
            assert np.array_equal(first, second)
            sizes.append(len(first))
    return sizes


def path(origin, frames, speed):
    """Poses along a curve, the car a little tilted."""
    return [
        transform(np.add(origin, (0.1 * k * speed, k * speed, 0)), (0.998, 0.02, 0.01, 0.05 - 0.002 * k))
        for k in range(frames)
    ]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    seed=st.integers(0, 2**31),
    origin=st.sampled_from(ORIGINS),
    speed=st.sampled_from([0.0, 0.4]),
    lidars=st.sampled_from([(True, False), (True,), (False,), (True, True, False)]),
    front=st.sampled_from([(-3, 13), (-30, -10), (0, 0), (40, 50)]),
    rear=st.sampled_from([(0, 30), (-5, 8)]),
    block=st.sampled_from([1, 4, 50]),
    options=st.fixed_dictionaries(
        {
            "mad_form": st.sampled_from(["deviation", "literal", "off"]),
            "points_per_voxel": st.sampled_from([0, 1, 3]),
            "pixels_per_point": st.sampled_from([0, 0.7, 2.5, 40]),
            "min_lidars_per_voxel": st.sampled_from([1, 2]),
            "mad_min_inliers": st.sampled_from([1, 2, 5]),
        }
    ),
)
def test_same_points_as_plain_numpy(camera, seed, origin, speed, lidars, front, rear, block, options):
    drive = Bursts(seed, origin, lidars)
    compare(
        drive,
        static_of(drive, origin, seed),
        camera,
        windows(drive, 40, front, rear),
        path(origin, 40, speed),
        default_settings("ground_truth") | options,
        block,
    )


@pytest.mark.parametrize("origin", ORIGINS)
def test_a_drive_through_the_scene_keeps_points(camera, origin):
    drive = Bursts(7, origin, (True, False), noise=0.01)
    options = default_settings("ground_truth") | {"pixels_per_point": 0}
    sizes = compare(
        drive,
        static_of(drive, origin, 7),
        camera,
        windows(drive, 30, (-3, 13), (0, 30)),
        path(origin, 30, 0.1),
        options,
        8,
    )
    assert max(sizes) > 300


def test_a_voxel_with_many_points(camera):
    drive = Bursts(3, ORIGINS[0], (True, False), noise=0.0)
    spot = np.array([0.53, 4.02, 0.31])
    rng = np.random.default_rng(0)
    drive._points = [spot + rng.uniform(0, 0.06, (n, 3)) for n in rng.integers(0, 60, len(drive.front))]
    static = static_of(drive, ORIGINS[0], 0)
    options = default_settings("ground_truth") | {"points_per_voxel": 7}
    grid = static.grid
    everything = StaticSet(
        grid, np.unique(grid.keys(np.concatenate(drive._points))), np.ones(1, np.int32), {}
    )
    sizes = compare(
        drive,
        everything,
        camera,
        windows(drive, 30, (-30, 13), (0, 30)),
        path(ORIGINS[0], 30, 0.0),
        options,
        50,
    )
    assert max(sizes) > 0


def test_no_static_voxel(camera):
    drive = Bursts(1, ORIGINS[0], (True, False))
    grid = static_of(drive, ORIGINS[0], 1).grid
    nothing = StaticSet(grid, np.empty(0, np.int64), np.empty(0, np.int32), {})
    options = default_settings("ground_truth")
    sizes = compare(
        drive, nothing, camera, windows(drive, 5, (-3, 13), (0, 30)), path(ORIGINS[0], 5, 1.0), options, 2
    )
    assert sizes == [0] * 5


def test_frames_out_of_order_are_refused(camera):
    drive = Bursts(1, ORIGINS[0], (True, False))
    wanted = windows(drive, 10, (-3, 13), (0, 30))
    window = StaticWindow(drive, static_of(drive, ORIGINS[0], 1), camera, default_settings("ground_truth"))
    window.open(np.arange(len(drive.front)))
    pose = path(ORIGINS[0], 1, 1.0)[0]
    window.select(wanted[9], -1, pose)
    with pytest.raises(AssertionError, match="order of time"):
        window.select(wanted[0], -1, pose)
