"""Board sessions against OpenCV, geometry and the truth beside them."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from card.artifacts import check, read_arrays, read_json, read_table, read_yaml
from card.artifacts.open3d import import_open3d
from card.errors import CardError
from card.geometry import CameraModel, Trajectory, apply, from_json, inverse
from card.geometry.corrections import correct_points
from card.recording.description import read_description
from card.recording.laz import read_burst
from card.recording.paths import LIDARS, list_bursts, list_images, stamp_of
from card.simulation import board
from card.simulation.scales import SCALES
from card.simulation.sessions import simulate_session
from card.simulation.survey import NOISE_M, POSES, SURVEYS, simulate_survey

SESSION = "2026-04-14-start"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    root = tmp_path_factory.mktemp("demo")
    simulate_session(SESSION, folder=root / "session", truth=root / "truth", scale="demo", seed=5)
    return root / "session", root / "truth"


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    root = tmp_path_factory.mktemp("survey")
    simulate_survey("2026-04-14", folder=root / "survey", truth=root / "truth", scale="demo", seed=5)
    return root / "survey", root / "truth"


def _detected(image: Path, corners: tuple[int, int]) -> np.ndarray:
    gray = cv2.imread(str(image), cv2.IMREAD_GRAYSCALE)
    found, pixels = cv2.findChessboardCorners(gray, corners)
    assert found, image
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 1e-3)
    return cv2.cornerSubPix(gray, pixels, (3, 3), (-1, -1), criteria)[:, 0]


def _projected(calibration: dict, camera: str, rig_from_board: np.ndarray) -> np.ndarray:
    camera_from_board = inverse(from_json(calibration["extrinsics"][f"rig_from_{camera}"])) @ rig_from_board
    model = CameraModel.from_json(calibration["cameras"][camera])
    return model.project(apply(camera_from_board, board.corners_m()))


@pytest.mark.parametrize("camera", ["camera_left", "camera_right"])
def test_opencv_finds_the_corners_where_the_truth_projects_them(
    demo: tuple[Path, Path], survey: tuple[Path, Path], camera: str
) -> None:
    errors = []
    for folder, truth in (demo, survey):
        corners = tuple(read_yaml(folder / "board.yaml", "board")["inner_corners"])
        calibration = read_json(truth / "calibration.json", "calibration")
        for view in read_json(truth / "board_poses.json", "board_poses")["views"]:
            (image,) = (folder / view["folder"] / camera).glob(f"{view['t_ns'] // 10**6}*.jpg")
            expected = _projected(calibration, camera, from_json(view["rig_from_board"]))
            errors.append(np.abs(_detected(image, corners) - expected).max())
    assert max(errors) < 0.5
    assert np.median(errors) < 0.25


def test_opencv_s_second_detector_agrees_up_to_the_corner_it_starts_from(demo: tuple[Path, Path]) -> None:
    folder, truth = demo
    calibration = read_json(truth / "calibration.json", "calibration")
    view = read_json(truth / "board_poses.json", "board_poses")["views"][0]
    gray = cv2.imread(str(folder / "camera_left" / f"{view['t_ns']}.jpg"), cv2.IMREAD_GRAYSCALE)
    found, pixels = cv2.findChessboardCornersSB(gray, board.INNER_CORNERS)
    expected = _projected(calibration, "camera_left", from_json(view["rig_from_board"]))
    assert found
    assert min(np.abs(p - expected).max() for p in (pixels[:, 0], pixels[::-1, 0])) < 0.5


def test_board_returns_lie_on_the_board_once_corrected(demo: tuple[Path, Path]) -> None:
    folder, truth = demo
    calibration = read_json(truth / "calibration.json", "calibration")
    rig_from_lidar = from_json(calibration["extrinsics"]["rig_from_lidar_front"])
    views = read_json(truth / "board_poses.json", "board_poses")["views"]
    bursts = list_bursts(folder, "lidar_front")
    assert len(bursts) == len(views) == SCALES["demo"].board_views
    raw, corrected = [], []
    for path, view in zip(bursts, views, strict=True):
        burst = read_burst(path)
        assert burst.t_ns < view["t_ns"] < burst.end_ns
        ranges = np.linalg.norm(burst.points, axis=1, keepdims=True)
        board_from_lidar = inverse(from_json(view["rig_from_board"])) @ rig_from_lidar
        ray_cosine = np.abs((burst.points / ranges) @ board_from_lidar[2, :3])
        whole = correct_points(burst.points, burst.ring, calibration["lidar_corrections"]["lidar_front"])
        for points, errors in ((burst.points, raw), (whole, corrected)):
            x, y, z = apply(board_from_lidar, points).T
            inside = np.abs(np.stack([x, y], axis=1) - (0.385, 0.22)) < (0.5, 0.34)
            on_board = inside.all(axis=1) & (np.abs(z) < 0.06)
            assert on_board.sum() > 10  # a quarter of a plate at six metres, by 200 columns
            errors.extend((z[on_board] / ray_cosine[on_board]).tolist())
    # 5 mm of noise and a step of 4 mm: sqrt(25 + 16 / 12) = 5.1 mm along the ray.
    assert np.std(corrected) == pytest.approx(0.0051, rel=0.1)
    assert abs(np.mean(corrected)) < 4 * 0.0051 / np.sqrt(len(corrected))
    assert np.std(raw) > 1.05 * np.std(corrected)  # each channel is off by some millimetres of its own


def test_the_mask_covers_the_car_and_only_the_bottom_of_the_image(demo: tuple[Path, Path]) -> None:
    folder, _ = demo
    calibration = read_json(folder / "calibration.json", "calibration")
    mask = cv2.imread(str(folder / "ego_mask.png"), cv2.IMREAD_UNCHANGED)
    size = calibration["camera_left_undistorted"]
    assert mask.shape == (size["height"], size["width"])
    assert set(np.unique(mask)) == {0, 255}
    assert (mask[-1] == 255).mean() > 0.8
    assert not mask[: size["height"] // 2].any()
    image = cv2.imread(str(list_images(folder, "camera_left")[0]), cv2.IMREAD_GRAYSCALE)
    camera = CameraModel.from_json(calibration["cameras"]["camera_left"])
    flat = cv2.undistort(image, camera.K, np.array(camera.distortion))
    assert np.percentile(flat[mask == 255], 90) < 40 < np.percentile(flat[mask == 0], 5)


def test_stereo_pairs_are_within_a_millisecond(demo: tuple[Path, Path]) -> None:
    left, right = ([stamp_of(p) for p in list_images(demo[0], c)] for c in ("camera_left", "camera_right"))
    assert all(0 < r - t < 1_000_000 for t, r in zip(left, right, strict=True))


def test_surveyed_points_are_the_truth_within_the_noise(survey: tuple[Path, Path]) -> None:
    folder, truth = survey
    calibration = read_json(truth / "calibration.json", "calibration")
    poses = read_json(truth / "board_poses.json", "board_poses")
    board_from = {v["folder"]: from_json(v["rig_from_board"]) for v in poses["views"]}
    marks = np.array(yaml.safe_load((folder / "board.yaml").read_text())["marked_points_m"])
    errors = []
    for number, station in enumerate(poses["stations"], 1):
        with (folder / f"survey-{number}" / "points.csv").open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == 8 + POSES * len(marks)
        for row in rows:
            xyz = [float(row[name]) for name in ("x_m", "y_m", "z_m")]
            check({**row, **dict(zip(("x_m", "y_m", "z_m"), xyz, strict=True))}, "survey_point", "row")
            if row["target"].startswith("wheel_"):
                wanted = np.array(calibration["wheels"][row["target"][6:]][f"{row['point']}_m"])
            else:
                mark = np.array([*marks[int(row["point"][1:]) - 1], 0.0])
                wanted = apply(board_from[f"survey-{number}/{row['target']}"], mark)
            errors.append(apply(from_json(station), np.array(xyz)) - wanted)
    assert len(poses["stations"]) == SURVEYS
    count = np.size(errors)
    assert np.std(errors) == pytest.approx(NOISE_M, rel=4 / np.sqrt(2 * count))
    assert abs(np.mean(errors)) < 4 * NOISE_M / np.sqrt(count)


@pytest.mark.parametrize("lidar", LIDARS)
def test_the_drive_s_points_lie_on_its_world_by_the_session_s_calibration(
    demo: tuple[Path, Path], lidar: str
) -> None:
    folder, truth = demo
    o3d = import_open3d()
    calibration = read_json(truth / "calibration.json", "calibration")
    path = Trajectory.from_table(read_table(truth / "drive" / "trajectory.parquet", "trajectory"))
    bursts = list_bursts(folder / "drive", lidar)
    assert set(read_description(folder / "drive")["sensors"]) == {*LIDARS, "imu"}
    assert len(bursts) == round(SCALES["demo"].session_s * 10) - 1
    burst = read_burst(bursts[-1])
    ranges = np.linalg.norm(burst.points, axis=1, keepdims=True)
    corrected = correct_points(burst.points, burst.ring, calibration["lidar_corrections"][lidar])
    rig_from_lidar = from_json(calibration["extrinsics"][f"rig_from_{lidar}"])
    points = apply(path.at(burst.time_ns) @ rig_from_lidar, corrected)
    world = read_arrays(truth / "drive" / "world.npz", "truth_world")
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(world["vertices"].astype(np.float32), world["triangles"].astype(np.uint32))
    near = ranges[:, 0] < 15
    distance = scene.compute_distance(o3d.core.Tensor(points[near].astype(np.float32))).numpy()
    # Noise of 5.1 mm along rays that meet the ground at a flat angle: less than that across the surface.
    assert np.median(distance) < 0.0035
    assert np.mean(distance < 0.02) > 0.97


def _session_and_survey(root: Path, seed: int, threads: int) -> dict[str, bytes]:
    simulate_session(SESSION, folder=root / "s", truth=root / "t", scale="tiny", seed=seed, threads=threads)
    simulate_survey("2026-04-14", folder=root / "v", truth=root / "u", scale="tiny", seed=seed)
    return {str(p.relative_to(root)): p.read_bytes() for p in sorted(root.rglob("*")) if p.is_file()}


def test_same_seed_same_bytes_by_however_many_processes(tmp_path: Path) -> None:
    first = _session_and_survey(tmp_path / "a", 1, threads=1)
    assert {"s/ego_mask.png", "s/drive/imu.parquet", "v/survey-3/points.csv"} < first.keys()
    assert first == _session_and_survey(tmp_path / "b", 1, threads=2)


def test_another_seed_makes_another_survey(tmp_path: Path) -> None:
    for seed in (1, 2):
        root = tmp_path / str(seed)
        simulate_survey("2026-04-14", folder=root / "v", truth=root / "u", scale="tiny", seed=seed)
    for one in (p for p in (tmp_path / "1").rglob("*.*") if p.suffix in (".jpg", ".csv")):
        assert one.read_bytes() != (tmp_path / "2" / one.relative_to(tmp_path / "1")).read_bytes()


def test_a_survey_of_no_day_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CardError, match="not a session"):
        simulate_survey("14 April", folder=tmp_path / "v", truth=tmp_path / "u", scale="tiny", seed=0)
    assert not any(tmp_path.iterdir())
