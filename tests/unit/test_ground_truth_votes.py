from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from card.artifacts import default_settings
from card.geometry import Trajectory
from card.ground_truth import visibility_votes as votes_module
from card.ground_truth.block_grid import block_grid
from card.ground_truth.icp_flow import FlowVotes, dynamic_by_flow, flow_residuals, flow_votes, scan_pairs
from card.ground_truth.planes import PlaneRule, find_planes
from card.ground_truth.rays import POSES, pose_times, ray_origins
from card.ground_truth.reference.crossed import crossed_voxels
from card.ground_truth.reference.surface import local_planes
from card.ground_truth.reference.visibility_votes import visibility_votes as plain_votes
from card.ground_truth.sweep_registration import MapTarget
from card.ground_truth.sweeps import Sweep
from card.ground_truth.visibility_votes import (
    Votes,
    evidence_sweeps,
    visibility_votes,
)
from card.ground_truth.voxel_map import build_voxel_map
from card.ground_truth.voxels import VoxelGrid, find, pack, unpack

#: Sweeps follow each other every 0.1 s.
SETTINGS = default_settings("ground_truth") | {"support_margin_s": 0.15}
GRID = VoxelGrid.around(Trajectory([0, 1], np.zeros((2, 3)), [[1, 0, 0, 0]] * 2), 0.1)


class StandingDrive:
    """Sweeps of a sensor that stands still while it turns; each has its own place."""

    def __init__(self, clouds: list[np.ndarray], origins: np.ndarray, front: np.ndarray) -> None:
        self.clouds, self.origins, self.front = clouds, origins, front
        self.start_ns = np.arange(len(clouds)) * 100_000_000
        self.end_ns = self.start_ns + 99_000_000

    def of(self, front: bool) -> np.ndarray:
        return np.flatnonzero(self.front == front)

    def poses(self, i: int, t_ns: np.ndarray) -> np.ndarray:
        poses = np.tile(np.eye(4), (len(t_ns), 1, 1))
        poses[:, :3, 3] = self.origins[i]
        return poses

    def sweep(self, i: int) -> Sweep:
        points = self.clouds[i]
        away = points - self.origins[i]
        turn = np.arctan2(away[:, 0], away[:, 1]) % (2 * np.pi) / (2 * np.pi)
        times = self.start_ns[i] + (turn * 99_000_000).astype(np.int64)
        return Sweep(points, times, np.zeros(len(points), np.uint8), 0, 0)

    def map(self):
        bursts = [(i, bool(self.front[i]), cloud) for i, cloud in enumerate(self.clouds)]
        return build_voxel_map(bursts, self.origins, GRID, SETTINGS)


def random_drive(seed: int, sweeps: int = 5) -> StandingDrive:
    rng = np.random.default_rng(seed)
    origins = np.stack([rng.normal(0, 0.5, sweeps), np.arange(sweeps), np.full(sweeps, 1.5)], axis=1)
    clouds = []
    for i in range(sweeps):
        away = rng.normal(0, 1, (700, 3))
        away[:, 2] = -np.abs(away[:, 2]) * 0.3 - 0.15
        away /= np.linalg.norm(away, axis=1, keepdims=True)
        ground = origins[i] + away * (-1.5 / away[:, 2:])
        blob = rng.normal(0, 0.3, (150, 3)) + np.array([2, 3, 0.5])
        clouds.append(np.concatenate([ground[np.linalg.norm(ground, axis=1) < 12], blob]))
    return StandingDrive(clouds, origins, np.arange(sweeps) % 2 == 0)


def brute_votes(drive, voxels, chosen, surface) -> np.ndarray:
    votes = np.zeros((5, len(chosen)), dtype=int)
    found = [np.flatnonzero([(GRID.keys(c) == voxels.keys[v]).any() for c in drive.clouds]) for v in chosen]
    margin = int(SETTINGS["support_margin_s"] * 1e9)
    for i, cloud in enumerate(drive.clouds):
        occupied = np.unique(GRID.indices(cloud), axis=0)
        lengths = np.linalg.norm(cloud - drive.origins[i], axis=1)
        d = (cloud - drive.origins[i]) / lengths[:, None]
        for k, v in enumerate(chosen):
            index = unpack(voxels.keys[v : v + 1])[0]
            c = GRID.corners(voxels.keys[v : v + 1])[0] + voxels.centroids[v]
            reach = np.abs(occupied - index).max(axis=1)
            if (reach == 0).any():
                votes[0, k] += 1
                continue
            t = (c - drive.origins[i]) @ d.T
            with np.errstate(divide="ignore"):
                faces = [(np.floor(c / 0.1) * 0.1 + f - drive.origins[i]) / d for f in (1e-7, 0.1 - 1e-7)]
            crosses = np.minimum(*faces).max(axis=1) <= np.maximum(*faces).min(axis=1)
            aside = np.linalg.norm(c - drive.origins[i] - t[:, None] * d, axis=1)
            passing = crosses & (aside <= 0.06) & (t >= 1) & (t <= 50) & (lengths - t >= 0.1)
            if not passing.any():
                continue
            first, last = drive.end_ns[found[k][[0, -1]]]
            elsewhen = not first - margin <= drive.end_ns[i] <= last + margin
            if (reach <= 2).any():
                votes[1, k] += 1
                votes[3, k] += elsewhen
                continue
            n = surface.normals[k]
            clear = (np.abs((cloud - c) @ n) > 0.1) & (np.abs(d @ n) > 0.12)
            moved = (passing & (lengths - t >= 0.3) & (clear | ~surface.planar[k])).any()
            votes[2, k] += moved
            votes[3:, k] += moved and elsewhen
    return votes


@pytest.mark.parametrize("seed", range(3))
def test_plain_votes_equal_a_search_over_all_rays_and_voxels(seed):
    drive = random_drive(seed)
    voxels = drive.map()
    every = plain_votes(drive, range(5), voxels, np.arange(len(voxels.keys)), SETTINGS)
    rare = np.r_[np.flatnonzero(every.moved), np.flatnonzero(every.beside)[::8]]
    chosen = np.union1d(rare, np.random.default_rng(seed).choice(len(voxels.keys), 150, replace=False))
    votes = plain_votes(drive, range(5), voxels, chosen, SETTINGS)
    wanted = brute_votes(drive, voxels, chosen, local_planes(voxels, chosen, SETTINGS))
    assert votes.hits.tolist() == wanted[0].tolist()
    assert votes.beside.tolist() == wanted[1].tolist()
    assert votes.moved.tolist() == wanted[2].tolist()
    assert votes.elsewhen.tolist() == wanted[3].tolist()
    assert votes.moved_elsewhen.tolist() == wanted[4].tolist()
    assert wanted.sum(axis=1).min() >= 3


def assert_same_votes(drive, chosen=None, **changed) -> Votes:
    voxels, filled = drive.map(), SETTINGS | changed
    chosen = np.arange(len(voxels.keys)) if chosen is None else chosen
    sweeps = range(len(drive.clouds))
    votes = visibility_votes(drive, sweeps, voxels, chosen, filled)
    plain = plain_votes(drive, sweeps, voxels, chosen, filled)
    for name in ("hits", "beside", "moved", "elsewhen", "moved_elsewhen"):
        assert np.array_equal(getattr(votes, name), getattr(plain, name)), name
    return votes


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("place", [(0, 0, 0), (-431.07, 12.3, -7.7)])
def test_compiled_votes_are_the_plain_ones(seed, place, monkeypatch):
    # Voxels are gathered anew every metre.
    monkeypatch.setattr(votes_module, "_REACH_M", 1.0)
    drive = random_drive(seed, 6)
    drive.clouds = [cloud + place for cloud in drive.clouds]
    drive.origins = drive.origins + place
    votes = assert_same_votes(drive)
    assert min(votes.hits.sum(), votes.beside.sum(), votes.moved.sum(), votes.elsewhen.sum()) > 15


@pytest.mark.parametrize(
    "changed",
    [
        {"near_voxels": 1},
        {"near_voxels": 4, "planar_min_voxels": 20},
        {"pass_max_range_m": 5.0, "pass_min_range_m": 0.0},
        {"pass_lateral_m": 0.02, "pass_beyond_m": 0.0, "moved_gap_m": 0.0},
        {"planar_max_thickness_m": 1.0, "planar_min_ratio": 1.0},
    ],
)
def test_compiled_votes_are_the_plain_ones_at_other_settings(changed):
    assert_same_votes(random_drive(1), **changed)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(-8, 8)] * 3), min_size=1, max_size=30),
    st.lists(st.tuples(*[st.integers(-2, 2)] * 3), min_size=3, max_size=3),
    st.sampled_from([0.05, 0.1, 0.23]),
)
def test_compiled_votes_are_the_plain_ones_on_any_rays(points, places, pitch):
    """Rays along axes and diagonals, through edges and corners of voxels, from faces."""
    clouds = [np.array(points[k::3] or points, dtype=np.float64) * pitch * (1, 2, 1) for k in range(3)]
    origins = np.array(places) * 0.05 + (0, -3, 0)
    clouds = [c[np.linalg.norm(c - o, axis=1) > 0.1] for c, o in zip(clouds, origins, strict=True)]
    drive = StandingDrive(clouds, origins, np.array([True, False, True]))
    assert_same_votes(drive, pass_min_range_m=0.2, pass_lateral_m=0.09, moved_gap_m=0.1)


@pytest.mark.parametrize("tilt", [0.0, 1e-17, -1e-16, 1e-13, -1e-11, 1e-9, -1e-7])
def test_rays_along_a_face_are_walked_to_their_end(tilt):
    """From a face, nearly along it: rounding may put the ray on either side."""
    origin = np.array([12.8, -3.2, 0.8])
    away = np.array([[tilt, 1.0, -tilt], [1.0, -tilt, tilt], [-tilt, tilt, -1.0], [0.7, 0.7, tilt]])
    clouds = [origin + away * r for r in (30.0, 20.0, 6.0)]
    drive = StandingDrive(clouds, np.tile(origin, (3, 1)), np.ones(3, bool))
    assert_same_votes(drive)


def test_a_sweep_with_a_wrong_pose_is_registered_before_it_votes():
    rng = np.random.default_rng(4)
    floor = rng.uniform(-8, 8, (40_000, 3)) * (1, 1, 0)
    walls = [rng.uniform(-8, 8, (12_000, 3)) * mask + (0, 0, 1.5) for mask in ((0, 1, 0.2), (1, 0, 0.2))]
    scene = np.concatenate([floor, walls[0] + (8, 0, 0), walls[1] + (0, 8, 0)])
    clouds = [scene[k::4] + rng.normal(0, 0.004, scene[k::4].shape) for k in range(4)]
    origins = np.array([[0.0, 0, 1.6], [0.6, 0, 1.6], [0, 0.6, 1.6], [0.6, 0.6, 1.6]])
    error = np.array([0.05, -0.04, 0.06])
    drive = StandingDrive(
        [*clouds[:3], clouds[3] + error], np.array([*origins[:3], origins[3] + error]), np.ones(4, bool)
    )
    voxels = drive.map()
    target = MapTarget(GRID.corners(voxels.keys) + voxels.centroids, origins[0], SETTINGS)
    points, moved = target.register(drive.clouds[3], np.tile(drive.origins[3], (len(drive.clouds[3]), 1)))
    # The map holds the wrong sweep too, a quarter of its points.
    assert np.abs(points - clouds[3]).max() < 0.03
    assert moved - origins[3] == pytest.approx(np.zeros_like(moved), abs=0.03)
    chosen = np.arange(len(voxels.keys))
    hits = [
        visibility_votes(drive, [3], voxels, chosen, SETTINGS | {"register_sweeps": registered}).hits
        for registered in (False, True)
    ]
    assert not np.array_equal(*hits)


def test_no_voxels_and_no_points_get_no_votes():
    drive = random_drive(0)
    assert len(assert_same_votes(drive, np.empty(0, dtype=np.int64)).hits) == 0
    drive.clouds[2] = np.empty((0, 3))
    assert_same_votes(drive)


def test_crossed_voxels_lie_side_by_side_along_the_ray():
    origin, direction = np.array([0.5, 0.5, -0.5]), np.array([0.6, -0.8, 0.0])
    crossed = crossed_voxels(origin, direction, 0.0, 5.0)
    assert crossed[0].tolist() == [0, 0, -1]
    assert crossed[-1].tolist() == [3, -4, -1]
    assert (np.abs(np.diff(crossed, axis=0)).sum(axis=1) == 1).all()
    assert len(crossed_voxels(origin, direction, 2.0, 1.0)) == 0


def test_the_block_grid_finds_each_voxel():
    indices = np.unique(np.random.default_rng(5).integers(1000, 1040, (3000, 3)), axis=0)
    grid = block_grid(pack(indices), indices[:1] - 30)
    for v, (x, y, z) in enumerate((indices - grid.low).tolist()):
        b = grid.block[x >> 3, y >> 3, z >> 3]
        assert grid.number[b, x & 7, (y & 7) * 8 + (z & 7)] == v
        assert (grid.bounds[b, :3] <= (x & 7, y & 7, z & 7)).all()
        assert (grid.bounds[b, 3:] >= (x & 7, y & 7, z & 7)).all()
    assert (grid.number >= 0).sum() == len(indices)
    assert sum(int(word).bit_count() for word in grid.bits.ravel()) == len(indices)
    assert (indices[0] - 30 - grid.low).min() >= 8
    assert (grid.block[[0, -1]] < 0).all()


def test_pose_times_stay_within_the_sweep():
    # A stamp of today needs 61 bits: through float64 the last time would lie beyond the end.
    start, end = 1_776_157_200_013_000_001, 1_776_157_200_112_999_999
    times = pose_times(start, end)
    assert (times[0], times[-1], len(times)) == (start, end, POSES)
    assert (np.diff(times) > 0).all()


def test_rays_start_where_the_moving_sensor_was():
    start, end = 1_776_157_200_000_000_000, 1_776_157_200_099_000_000
    times = start + np.array([0, 33_000_001, 99_000_000])
    path = Trajectory([start, end + 1], [[0, 0, 0], [1, 2, 0.0]], [[1, 0, 0, 0]] * 2)
    drive = SimpleNamespace(start_ns=[start], end_ns=[end], poses=lambda i, t: path.at(t))
    sweep = Sweep(np.ones((3, 3)), times, np.zeros(3, np.uint8), 0, 0)
    assert ray_origins(drive, 0, sweep) == pytest.approx(path.at(times)[:, :3, 3], abs=1e-9)


def test_compiled_planes_are_the_plain_ones():
    voxels = random_drive(3).map()
    chosen = np.arange(len(voxels.keys))
    surface = local_planes(voxels, chosen, SETTINGS)
    grid = block_grid(voxels.keys, unpack(voxels.keys[:1]))
    normals, planar = np.empty((len(chosen), 3), np.float32), np.full(len(chosen), -1, np.int8)
    wanted = chosen % 3 > 0
    cells = unpack(voxels.keys) - grid.low
    find_planes(grid, cells, voxels.centroids, 0.1, wanted, PlaneRule(2, 6, 0.035, 2.5), normals, planar)
    assert np.array_equal(planar[wanted], surface.planar[wanted])
    assert (planar[~wanted] == -1).all()
    both = planar == 1
    assert np.abs((normals * surface.normals)[both].sum(axis=1)) == pytest.approx(1, abs=1e-6)


def test_planes_equal_a_loop_over_neighbours():
    voxels = random_drive(3).map()
    chosen = np.arange(0, len(voxels.keys), 7)
    surface = local_planes(voxels, chosen, SETTINGS)
    indices = unpack(voxels.keys)
    means = GRID.corners(voxels.keys) + voxels.centroids
    for k, v in enumerate(chosen):
        near = means[np.abs(indices - indices[v]).max(axis=1) <= 2]
        variance, axes = np.linalg.eigh(np.cov(near.T, bias=True) if len(near) > 1 else np.zeros((3, 3)))
        s = np.sqrt(np.maximum(variance, 0))
        margin = min(abs(s[0] - 0.035), abs(s[1] - 2.5 * s[0]))
        if len(near) >= 6 and margin > 1e-6:
            assert surface.planar[k] == (s[0] < 0.035 and s[1] > 2.5 * s[0])
        if surface.planar[k]:
            assert len(near) >= 6
            assert abs(surface.normals[k] @ axes[:, 0]) == pytest.approx(1, abs=1e-4)
    assert 10 < surface.planar.sum() < len(chosen)


def test_evidence_sweeps_keep_their_distance_and_thin_a_lidar_at_a_time():
    origins = np.stack([np.arange(12) * 0.3, np.zeros(12), np.zeros(12)], axis=1)
    times = np.arange(12) * 100_000_000
    drive = SimpleNamespace(origins=origins, front=np.arange(12) % 2 == 0, end_ns=times)
    drive.of = lambda front: np.flatnonzero(drive.front == front)

    def chosen(baseline: float, gap_s: float = 9.0, step: int = 1) -> list[int]:
        changed = {"flow_baseline_m": baseline, "evidence_gap_s": gap_s, "evidence_step": step}
        return evidence_sweeps(drive, SETTINGS | changed)

    assert chosen(0.5) == list(range(12))
    assert chosen(1.19) == [0, 1, 4, 5, 8, 9]
    assert chosen(1.19, step=2) == [0, 1, 8, 9]
    # Where the car stands, time goes on.
    assert chosen(99.0) == [0, 1]
    assert chosen(99.0, gap_s=0.4) == [0, 1, 4, 5, 8, 9]


def test_pairs_of_one_lidar_by_distance_and_time():
    origins = np.stack([np.arange(20) * 0.1, np.zeros(20), np.zeros(20)], axis=1)
    drive = StandingDrive([np.zeros((0, 3))] * 20, origins, np.arange(20) % 2 == 0)
    pairs = scan_pairs(drive, 0.5, 0.8)
    # 0.5 m are five bursts, 0.8 s are eight: the first of the same LiDAR.
    assert pairs[:3] == [(0, 8), (2, 10), (4, 12)]
    assert all(j - i == 8 for i, j in pairs)


def test_residuals_survive_a_pose_error_but_show_what_moved():
    rng = np.random.default_rng(0)
    ground = np.stack([*rng.uniform(-6, 6, (2, 4000)), rng.normal(0, 0.005, 4000)], axis=1)
    wall = np.stack([np.full(2500, 5.0), rng.uniform(-6, 6, 2500), rng.uniform(0, 3, 2500)], axis=1)
    front = np.stack([rng.uniform(-6, 6, 2500), np.full(2500, 6.0), rng.uniform(0, 3, 2500)], axis=1)
    box = rng.uniform(-0.3, 0.3, (300, 3)) + np.array([0, 0, 1])
    origin = np.array([1e5, -2e5, 30.0])
    first = np.concatenate([ground, wall, front, box]) + origin
    second = np.concatenate([ground, wall, front, box + np.array([1.5, 0, 0])]) + origin + (0.15, 0.12, 0.0)
    residuals = flow_residuals(first, second, origin, SETTINGS)
    assert np.median(residuals[:-300]) < 0.03
    assert (residuals[-300:] > 0.1).all()


def test_flow_votes_count_a_voxel_once_a_pair():
    cloud = np.random.default_rng(1).uniform(-3, 3, (3000, 3)) * (1, 1, 0.01)
    origins = np.arange(8)[:, None] * np.array([[0.2, 0, 0]])
    drive = StandingDrive([cloud] * 8, origins, np.ones(8, bool))
    voxels = drive.map()
    votes = flow_votes(drive, voxels, SETTINGS)
    assert len(scan_pairs(drive, 0.5, 0.5)) == 3
    assert (votes.comparisons == 3).all()
    assert not votes.moved.any()
    assert (find(voxels.keys, GRID.keys(cloud)) >= 0).all()


def test_a_submap_of_sparse_sweeps_contradicts_less_of_a_static_floor():
    rng = np.random.default_rng(2)
    floor = rng.uniform(-3, 3, (12_000, 3)) * (1, 1, 0.002)
    wall = rng.uniform(-3, 3, (12_000, 3)) * (0.002, 1, 0.5) + (3, 0, 1.5)
    clouds = [np.concatenate([floor[k::12], wall[k::12]]) for k in range(12)]
    origins = np.arange(12)[:, None] * np.array([[0.2, 0, 0]]) + (0, 0, 1)
    drive = StandingDrive(clouds, origins, np.ones(12, bool))
    voxels = drive.map()
    moved = {
        method: flow_votes(drive, voxels, SETTINGS | {"flow_method": method}).moved.sum()
        for method in ("literal", "submap")
    }
    assert 0 < moved["submap"] < 0.2 * moved["literal"]


def test_dynamic_by_flow_wants_votes_and_share():
    votes = FlowVotes(np.array([1, 2, 7, 6]), np.array([1, 2, 10, 10]))
    assert dynamic_by_flow(votes, SETTINGS).tolist() == [False, True, True, False]
