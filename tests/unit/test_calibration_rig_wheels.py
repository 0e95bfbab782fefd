"""Rig-wheel calibration against the simulated car, a second estimator, and surveys that are wrong."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from survey_scene import NOISE_M, NOISE_PX, Scene, surveyed_day

from card.artifacts import default_settings, read_json
from card.calibration.board_pose import board_pose
from card.calibration.rig_wheels import align_surveys, calibrate_rig_wheels
from card.calibration.state import moved
from card.calibration.survey_alignment import Alignment, align_station
from card.calibration.survey_points import WHEEL_POINTS, WHEELS
from card.calibration.wheel_mean import Wheels, mean_wheels
from card.errors import CardError
from card.geometry import apply
from card.simulation import board

SETTINGS = default_settings("calibration")
CONTACTS = slice(1, None, 2)


def estimated(scene: Scene) -> tuple[list[Alignment], Wheels]:
    observed = scene.observed()
    boards = [
        np.stack([board_pose(scene.sensors, seen.corners, pixels, 1.0)[0] for pixels in seen.pixels])
        for seen in observed
    ]
    alignments, sigmas = align_surveys(scene.sensors, observed, boards, (NOISE_PX, NOISE_M))
    return alignments, mean_wheels(alignments, scene.surveyed_wheels, sigmas[1])


def run(scene: Scene, folder: Path, change: Callable[[dict[str, Path]], None] | None = None) -> dict:
    paths = scene.write(folder)
    if change:
        change(paths)
    calibrate_rig_wheels(**paths, settings=SETTINGS, gates=[])
    return read_json(paths["rig_wheels"], "rig_wheels_calibration")


def notes(folder: Path) -> list[str]:
    return read_json(folder / "rig_wheels.report.json", "report")["notes"]


def contacts_mm(document: dict, scene: Scene) -> np.ndarray:
    found = np.array([document["camera_left"]["wheels"][wheel]["contact_m"] for wheel in WHEELS])
    return 1e3 * np.linalg.norm(found - scene.wheels[CONTACTS], axis=1)


def test_a_document_of_each_frame(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    document = run(scene, tmp_path)
    assert document["verdict"]["passed"]
    assert document["quality"]["survey_sigma_mm"] == pytest.approx(1, rel=0.25)
    assert contacts_mm(document, scene).max() < 4
    sensors = scene.sensors
    for wheel in WHEELS:
        in_camera, in_lidar = (
            document[frame]["wheels"][wheel]["contact_m"] for frame in ("camera_left", "lidar_front")
        )
        np.testing.assert_allclose(apply(sensors.lidar_from_left, np.array([in_camera])), [in_lidar])
    for survey in document["surveys"]:
        # Two witnesses for the station's pose: the closed form, and the refinement it starts.
        assert survey["closed_form_deg"] < 0.1
        assert survey["closed_form_mm"] < 8
        assert survey["points"] == survey["inliers"] == 24
    assert not notes(tmp_path)


@pytest.mark.parametrize("seeds", [25, pytest.param(100, marks=pytest.mark.slow)])
def test_contacts_within_two_millimetres_and_covariances_neither_boast_nor_hide(seeds: int) -> None:
    squares: dict[str, list[float]] = {"camera": [], "lidar": [], "contacts": []}
    errors, single = [], []
    for seed in range(seeds):
        scene = surveyed_day(1000 + seed)
        _, wheels = estimated(scene)
        points, covariance = wheels.in_camera(scene.sensors)
        squares["camera"].append(_square(points - scene.wheels, covariance))
        index = np.arange(24).reshape(-1, 3)[CONTACTS].ravel()
        off = (points - scene.wheels)[CONTACTS]
        squares["contacts"].append(_square(off, covariance[np.ix_(index, index)]))
        in_lidar, covariance = wheels.in_lidar(scene.sensors)
        squares["lidar"].append(_square(in_lidar - scene.in_lidar, covariance))
        errors.append(np.linalg.norm(off, axis=1).max())
        single.append(np.linalg.norm(wheels.each_m[0] - scene.wheels, axis=1)[CONTACTS].max())
    median, p95, alone = 1e3 * np.median(errors), 1e3 * np.percentile(errors, 95), 1e3 * np.median(single)
    print(f"worst contact: median {median:.2f} mm, p95 {p95:.2f} mm; one survey: median {alone:.2f} mm")
    assert median <= 2.0
    assert median < alone
    for name, values in squares.items():
        size = 12 if name == "contacts" else 24
        low, high = chi2.ppf([0.025, 0.975], size * seeds) / seeds
        print(f"{name}: mean normalised error squared {np.mean(values):.2f}, {low:.2f} to {high:.2f}")
        assert low < np.mean(values) < high


def _square(off: np.ndarray, covariance: np.ndarray) -> float:
    return float(off.ravel() @ np.linalg.solve(covariance, off.ravel()))


def test_the_mean_on_se3_is_that_of_least_squares_on_the_points() -> None:
    """Second witness: the best linear mean of 24 coordinates, each survey weighted by its covariance."""
    scene = surveyed_day(3)
    alignments, wheels = estimated(scene)
    information, weighted = np.zeros((24, 24)), np.zeros(24)
    for alignment, points in zip(alignments, wheels.each_m, strict=True):
        jacobian = np.concatenate(
            [_by_step(alignment, points, axis)[..., None] for axis in range(6)], axis=-1
        )
        jacobian = jacobian.reshape(24, 6)
        weight = np.linalg.inv(jacobian @ alignment.covariance @ jacobian.T + NOISE_M**2 * np.eye(24))
        information += weight
        weighted += weight @ points.ravel()
    direct = np.linalg.solve(information, weighted).reshape(8, 3)
    assert np.abs(direct - wheels.points_m).max() < 2e-5
    ours, direct_variance = (np.diag(c) for c in (wheels.covariance, np.linalg.inv(information)))
    np.testing.assert_allclose(ours, direct_variance, rtol=0.3)


def _by_step(alignment: Alignment, points: np.ndarray, axis: int) -> np.ndarray:
    step = np.zeros(6)
    step[axis] = 1e-6
    there = apply(np.linalg.inv(alignment.left_from_station), points)
    return (apply(moved(alignment.left_from_station, step), there) - points) / 1e-6


def test_the_estimate_moves_with_the_cameras_as_its_derivatives_say() -> None:
    scene = surveyed_day(4)
    (seen, *_), sensors = scene.observed(), scene.sensors
    boards = np.stack([board_pose(sensors, seen.corners, pixels, 1.0)[0] for pixels in seen.pixels])
    found = align_station(sensors, seen, boards, NOISE_PX, NOISE_M)
    sigma = np.sqrt(np.diag(sensors.covariance))
    for parameter in (0, 2, 4, 12, 19, 22):
        shift = np.zeros(24)
        shift[parameter] = sigma[parameter]
        other = replace(
            sensors,
            intrinsics=sensors.intrinsics + shift[:18].reshape(2, 9),
            left_from_right=moved(sensors.left_from_right, shift[18:]),
        )
        change = align_station(other, seen, boards, NOISE_PX, NOISE_M).left_from_station
        predicted = moved(found.left_from_station, found.by_cameras @ shift)
        moved_by = np.abs(change - found.left_from_station).max()
        assert np.abs(change - predicted).max() < 0.05 * moved_by + 1e-7, parameter


def test_two_points_named_one_for_the_other_are_mended_and_told(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.marks[1, 2][[2, 4]] = scene.marks[1, 2][[4, 2]]
    assert contacts_mm(run(scene, tmp_path), scene).max() < 4
    assert "survey-2, pose-3: p3 and p5 were named one for the other; mended" in notes(tmp_path)


def test_one_stray_point_is_left_out_and_told(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.marks[0, 1, 6] += [0.03, -0.02, 0.02]
    document = run(scene, tmp_path)
    assert contacts_mm(document, scene).max() < 4
    assert document["surveys"][0]["points"] == 23
    (told,) = notes(tmp_path)
    assert told.startswith("survey-1, pose-2: p7 lies 4")
    assert told.endswith("mm off where the others have it; not used")


def test_wheel_points_named_one_for_the_other_are_mended_and_told(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.surveyed_wheels[2][[0, 1]] = scene.surveyed_wheels[2][[1, 0]]
    assert contacts_mm(run(scene, tmp_path), scene).max() < 4
    told = "survey-3: center of wheel_fl and contact of wheel_fl were named one for the other; mended"
    assert told in notes(tmp_path)


def refused(scene: Scene, folder: Path, change: Callable[[dict[str, Path]], None] | None = None) -> str:
    with pytest.raises(CardError) as error:
        run(scene, folder, change)
    assert not (folder / "rig_wheels.json").exists()
    assert not (folder / "rig_wheels.report.json").exists()
    return str(error.value)


def test_a_wheel_point_that_no_other_survey_has_there_is_named(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.surveyed_wheels[1][WHEEL_POINTS.index(("wheel_rr", "contact"))] += [0.05, 0, 0]
    told = refused(scene, tmp_path)
    assert told.startswith("survey-2: wheel points have another shape than in survey-1")
    assert "contact of wheel_rr does not fit" in told


def test_surveys_of_two_cars_are_refused(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    for survey in (1, 2):
        scene.surveyed_wheels[survey][4:] += [0.1 * survey, 0, 0]
    assert "wheel points have another shape" in refused(scene, tmp_path)


def test_a_board_moved_between_survey_and_images_is_named(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.marks[2, 0] += [0.03, 0.01, 0.0]
    told = refused(scene, tmp_path)
    assert told.startswith("survey-3: the board was not where the images show it in pose-1")
    assert "was it moved" in told


def test_a_board_moved_while_it_was_measured_is_named(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.marks[0, 1, 4:] += [0.0, 0.04, 0.02]
    told = refused(scene, tmp_path)
    assert told.startswith("survey-1: points of pose-2 do not have the shape of the board (found p")
    assert "was the board moved while it was measured?" in told


def test_points_numbered_as_seen_from_behind_are_refused(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.marks[0, 2] = scene.marks[0, 2][[2, 1, 0, 7, 6, 5, 4, 3]]
    assert "survey-1: the board was not where the images show it in pose-3" in refused(scene, tmp_path)


def _in_millimetres(paths: dict[str, Path]) -> None:
    path = paths["survey"] / "survey-2" / "points.csv"
    head, *rows = (line.split(",") for line in path.read_text().splitlines())
    scaled = [[*row[:2], *(str(1000 * float(cell)) for cell in row[2:])] for row in rows]
    path.write_text("\n".join(",".join(row) for row in [head, *scaled]) + "\n")


def _without(path: Path, start: str) -> None:
    lines = path.read_text().splitlines(keepends=True)
    kept = [line for line in lines if not line.startswith(start)]
    assert len(kept) < len(lines)
    path.write_text("".join(kept))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            _in_millimetres,
            "survey-2/points.csv: points of pose-1 are not in metres (found 1e+03 times as far",
        ),
        (
            lambda paths: _without(paths["survey"] / "survey-3" / "points.csv", "wheel_rl,contact"),
            "survey-3/points.csv: contact of wheel_rl is missing",
        ),
        (
            lambda paths: _without(paths["survey"] / "survey-1" / "points.csv", "pose-2"),
            "survey-1/points.csv: too few poses of the board (found pose-1, pose-3, wanted at least 3)",
        ),
        (
            lambda paths: [
                _without(paths["survey"] / "survey-1" / "points.csv", f"pose-2,p{n}") for n in range(1, 5)
            ],
            "survey-1/points.csv: too few points of pose-2 (found 4, wanted at least 5)",
        ),
        (
            lambda paths: (paths["survey"] / "survey-2" / "points.csv").unlink(),
            "survey-2/points.csv: file is missing",
        ),
        (
            lambda paths: (paths["survey"] / "survey-2" / "points.csv").write_text("a,b\n"),
            "survey-2/points.csv: wrong columns",
        ),
    ],
)
def test_incomplete_surveys_are_refused(tmp_path: Path, change: Callable, told: str) -> None:
    assert told in refused(surveyed_day(0), tmp_path, change)


@pytest.mark.parametrize(
    ("row", "told"),
    [
        ("pose-1,p3,1,2,3", "points.csv:34: p3 of pose-1 is there twice"),
        ("pose-1,p9,1,2,3", "points.csv: p9 of pose-1 is no point of the board"),
        ("wheel_fl,p1,1,2,3", "points.csv: p1 of wheel_fl is no point of a wheel"),
        ("pose-1,p8,1,2,high", "points.csv:34: coordinate is not a number (found 'high')"),
        ("pole-1,p8,1,2,3", "points.csv:34: target does not fit schema survey_point"),
    ],
)
def test_wrong_rows_are_refused(tmp_path: Path, row: str, told: str) -> None:
    def append(paths: dict[str, Path]) -> None:
        with (paths["survey"] / "survey-1" / "points.csv").open("a") as file:
            file.write(row + "\n")

    assert told in refused(surveyed_day(0), tmp_path, append)


def test_a_pose_without_images_is_named(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.pixels = scene.pixels[:2]
    marks, wheels = scene.marks, scene.surveyed_wheels
    assert len(marks) == len(wheels) == 3
    assert "survey-3/pose-1: no stereo pair shows the board" in refused(scene, tmp_path)


def test_images_of_other_cameras_are_named(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.pixels[1, 1, 1, :, 0] += np.linspace(0, 12, len(board.corners_m()))
    told = refused(scene, tmp_path)
    assert told.startswith("survey-2/pose-2: the images of the board do not fit the cameras")


def test_wrong_corners_are_left_out_and_told(tmp_path: Path) -> None:
    scene = surveyed_day(0)
    scene.pixels[0, 2, 0, 7] += [8.0, -9.0]
    scene.pixels[0, 2, 1, 31] += [0.0, 4.0]
    document = run(scene, tmp_path)
    assert contacts_mm(document, scene).max() < 4
    assert document["quality"]["reprojection_rms_px"] < 0.2
    assert notes(tmp_path) == ["survey-1/pose-3: 2 corners are wrong and not used"]


def test_same_input_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        run(surveyed_day(2), tmp_path / name)
    one, other = ((tmp_path / name / "rig_wheels.json").read_bytes() for name in ("a", "b"))
    assert one == other
