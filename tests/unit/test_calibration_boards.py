"""The board in images: corners where geometry puts them, and each kind of bad image refused by name."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from board_pictures import picture, poses, small_rig, stamps, tones, write_picture, write_session
from session_files import left_from_right

from card.artifacts import default_settings, read_json, read_table
from card.calibration import chessboard
from card.calibration.cameras import calibrate_cameras
from card.calibration.chessboard import find_chessboard
from card.calibration.detect_boards import detect_boards
from card.calibration.state import step_between
from card.errors import CardError
from card.geometry import apply, from_json, inverse
from card.simulation import board
from card.simulation.board_images import write_board_yaml
from card.simulation.quads import QuadView
from card.simulation.rig import CAMERAS

COUNT = 6
SETTINGS = default_settings("calibration")["boards"]
COLUMNS, ROWS = board.INNER_CORNERS
#: Views by the distance of the board.
NEAREST = np.argsort(poses(COUNT)[:, 1, 3])


def truth(camera: str, number: int) -> np.ndarray:
    rig = small_rig()
    camera_from_board = inverse(rig.rig_from[camera]) @ poses(COUNT)[number]
    return rig.cameras[camera].project(apply(camera_from_board, board.corners_m()))


def run(session: Path, threads: int = 1) -> tuple[dict[str, Any], dict[str, Any]]:
    out = session.parent
    detect_boards(
        session=session,
        boards=out / "boards.parquet",
        report=out / "boards.report.json",
        settings=default_settings("calibration"),
        gates=[],
        threads=threads,
    )
    table = read_table(out / "boards.parquet", "board_detections").to_pydict()
    return table, read_json(out / "boards.report.json", "report")


def corners_in(pixels: np.ndarray, columns: int = COLUMNS, rows: int = ROWS) -> np.ndarray:
    found, reason = find_chessboard(pixels, columns, rows, SETTINGS)
    assert found is not None, reason
    return found


@pytest.mark.parametrize("camera", CAMERAS)
def test_corners_are_where_the_camera_model_projects_them(camera: str) -> None:
    errors = np.array([corners_in(picture(camera, COUNT, i)) - truth(camera, i) for i in range(COUNT)])
    assert np.sqrt(np.mean(errors**2)) < 0.12
    assert np.abs(errors.mean(axis=(0, 1))).max() < 0.03


def test_the_sector_detector_is_the_more_exact_one(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = small_rig()
    camera, pose = rig.cameras["camera_left"], rig.rig_from["camera_left"]
    big = replace(camera, width=1240, height=1240, fx=2 * camera.fx, fy=2 * camera.fy)
    big = replace(big, cx=2 * camera.cx + 0.5, cy=2 * camera.cy + 0.5)
    view, rms = QuadView(big, pose, samples=2), {}
    pictures = [tones(view, poses(COUNT)[number], number) for number in NEAREST[:3]]
    expected = [
        big.project(apply(inverse(pose) @ poses(COUNT)[number], board.corners_m())) for number in NEAREST[:3]
    ]
    for name in ("sectors", "saddle points"):
        errors = [corners_in(picture) - truth for picture, truth in zip(pictures, expected, strict=True)]
        rms[name] = np.sqrt(np.mean(np.square(errors)))
        monkeypatch.setattr(chessboard, "_by_sectors", lambda _, lattice: lattice)
    assert rms["sectors"] < 0.8 * rms["saddle points"]
    assert rms["sectors"] < 0.04


def test_small_squares_are_not_drawn_apart() -> None:
    """A detector that shifts outer corners outwards makes the board larger, and the focal length longer."""
    small = [i for i in range(COUNT) if _square_px(truth("camera_left", i)) < SETTINGS["sector_square_px"]]
    assert len(small) >= 3
    expected = np.array([truth("camera_left", i) for i in small])
    errors = np.array([corners_in(picture("camera_left", COUNT, i)) for i in small]) - expected
    from_middle = expected - expected.mean(axis=1, keepdims=True)
    scale = np.sum(errors * from_middle) / np.sum(from_middle**2)
    assert abs(scale) < 2e-4


def _square_px(corners: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(corners.reshape(ROWS, COLUMNS, 2), axis=1), axis=2).min())


def test_a_board_upside_down_starts_at_the_same_corner() -> None:
    pixels = picture("camera_left", COUNT, 1)
    upright = corners_in(pixels)
    turned = corners_in(np.ascontiguousarray(pixels[::-1, ::-1]))
    height, width = pixels.shape
    np.testing.assert_allclose((width - 1, height - 1) - turned, upright, atol=0.1)


def test_empty_and_blurred_images_are_refused() -> None:
    pixels = picture("camera_left", COUNT, NEAREST[0])
    empty = np.full_like(pixels, 128)
    assert find_chessboard(empty, COLUMNS, ROWS, SETTINGS) == (None, "no board with 8 x 5 inner corners")
    reasons = set()
    for sigma in (2.2, 3.0, 8.0):
        found, reason = find_chessboard(cv2.GaussianBlur(pixels, (0, 0), sigma), COLUMNS, ROWS, SETTINGS)
        assert found is None
        reasons.add(reason.split()[0])
    assert "blurred:" in reasons
    faint = (128 + (pixels.astype(float) - 128) * 0.08).astype(np.uint8)
    found, reason = find_chessboard(faint, COLUMNS, ROWS, SETTINGS)
    assert found is None
    assert reason.startswith(("contrast", "no board"))


@pytest.mark.parametrize("wrong", [(7, 4), (6, 5), (8, 3)])
def test_a_part_of_a_larger_board_is_not_taken_for_the_board(wrong: tuple[int, int]) -> None:
    found, reason = find_chessboard(picture("camera_left", COUNT, sum(wrong) % COUNT), *wrong, SETTINGS)
    assert found is None
    assert "no board" in reason or "goes on beyond" in reason


def test_an_exhaustive_search_would_take_the_part_for_the_whole_and_is_caught() -> None:
    """The search that finds a part of the board: what tells it from a whole one is what lies beyond."""
    from card.calibration.chessboard_checks import goes_on

    pixels = picture("camera_left", COUNT, 0)
    whole = corners_in(pixels).reshape(ROWS, COLUMNS, 2)
    assert goes_on(pixels, whole) is None
    assert goes_on(pixels, whole[:, :-1]) == "right"
    assert goes_on(pixels, whole[1:]) == "top"
    assert goes_on(pixels, whole[:-2, 1:]) in ("left", "bottom")


def test_the_table_holds_both_cameras_and_the_notes_name_what_was_refused(tmp_path: Path) -> None:
    session = write_session(tmp_path / "2026-04-14-start", COUNT)
    blank = np.full((620, 620), 90, np.uint8)
    write_picture(session / "camera_right" / f"{stamps(3)['camera_right']}.jpg", blank)
    (session / "camera_right" / f"{stamps(4)['camera_right']}.jpg").unlink()
    table, report = run(session, threads=2)
    views = {camera: set() for camera in CAMERAS}
    for camera, view in zip(table["camera"], table["view"], strict=True):
        views[camera].add(view)
    names = [str(stamps(i)["camera_left"]) for i in range(COUNT)]
    assert views["camera_left"] == set(names) - {names[4]}
    assert views["camera_right"] == set(names) - {names[3], names[4]}
    assert report["counts"] == {"views": 5, "views_with_board": 4, "images_refused": 1}
    assert f"camera_left/{names[4]}.jpg has no right image within 1 ms" in report["notes"]
    assert f"camera_right of view {names[3]}: no board with 8 x 5 inner corners" in report["notes"]
    rows = [
        i
        for i, key in enumerate(zip(table["camera"], table["view"], strict=True))
        if key == ("camera_left", names[0])
    ]
    found = np.array([[table["x_px"][i], table["y_px"][i]] for i in rows])
    np.testing.assert_allclose(found, truth("camera_left", 0), atol=0.4)


def test_processes_do_not_change_the_bytes(tmp_path: Path) -> None:
    session = write_session(tmp_path / "session", 3)
    run(session)
    alone = (tmp_path / "boards.parquet").read_bytes()
    run(session, threads=3)
    assert (tmp_path / "boards.parquet").read_bytes() == alone


def test_views_of_a_survey_are_named_by_folder(tmp_path: Path) -> None:
    survey = tmp_path / "2026-04-14-leica"
    survey.mkdir()
    write_board_yaml(survey)
    for number in range(2):
        for camera, t_ns in stamps(number).items():
            folder = survey / "survey-1" / f"pose-{number + 1}" / camera
            write_picture(folder / f"{t_ns}.jpg", picture(camera, COUNT, number))
    table, _ = run(survey)
    assert list(dict.fromkeys(table["view"])) == ["survey-1/pose-1", "survey-1/pose-2"]


def test_a_session_whose_board_is_another_one_is_refused(tmp_path: Path) -> None:
    session = write_session(tmp_path / "session", 2)
    document = yaml.safe_load((session / "board.yaml").read_text())
    (session / "board.yaml").write_text(yaml.safe_dump(document | {"inner_corners": [7, 4]}))
    first = stamps(0)["camera_left"]
    with pytest.raises(CardError, match=f"no view shows the board.*camera_left of view {first}.*7 x 4"):
        run(session)
    assert not (tmp_path / "boards.parquet").exists()
    (session / "board.yaml").write_text(yaml.safe_dump(document | {"inner_corners": [7, 5]}))
    with pytest.raises(CardError, match=r"looks the same upside down.*7 x 5"):
        run(session)


def test_images_of_another_size_and_unreadable_ones_are_named(tmp_path: Path) -> None:
    session = write_session(tmp_path / "session", 2)
    path = session / "camera_right" / f"{stamps(1)['camera_right']}.jpg"
    write_picture(path, picture("camera_right", COUNT, 1)[:-20])
    with pytest.raises(CardError, match=r"camera_right of view 2000000000 has another size.*620 x 600"):
        run(session)
    path.write_bytes(b"no image")
    with pytest.raises(CardError, match=f"{path.name}: unreadable image"):
        run(session)


def test_cameras_come_from_images_alone(tmp_path: Path) -> None:
    session = write_session(tmp_path / "session", 14)
    run(session)
    calibrate_cameras(
        boards=tmp_path / "boards.parquet",
        board=session / "board.yaml",
        cameras=tmp_path / "cameras.json",
        report=tmp_path / "cameras.report.json",
        settings=default_settings("calibration"),
        gates=[],
    )
    document = read_json(tmp_path / "cameras.json", "camera_calibration")
    error = step_between(left_from_right(small_rig()), from_json(document["left_from_right"]))
    assert np.degrees(np.linalg.norm(error[3:])) < 0.06
    assert np.linalg.norm(error[:3]) < 1.5e-3
    assert document["quality"]["reprojection_rms_px"] < 0.15


def test_real_images_are_found_and_parts_of_their_board_are_not() -> None:
    data = os.environ.get("CARD_TEST_DATA")
    if not data or not Path(data, "camera_chessboard").is_dir():
        pytest.skip("CARD_TEST_DATA has no camera_chessboard")
    images = sorted(Path(data, "camera_chessboard").glob("*.jpg"))
    grey = [cv2.imread(str(image), cv2.IMREAD_GRAYSCALE) for image in images]
    found = np.array([corners_in(pixels, 15, 17) for pixels in grey])
    assert len(found) == 6
    for pixels in grey[:1]:  # a part of the board is found by an exhaustive search
        part, reason = find_chessboard(pixels, 13, 16, SETTINGS)
        assert part is None, reason
