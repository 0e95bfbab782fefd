"""Faces and plates are there for a detector that never saw this code."""

import cv2
import numpy as np
import pytest

from card.errors import CardError
from card.simulation.bodies import car, walker
from card.simulation.faces_and_plates import PLATE_SIZE_M, face_texture, plate_texture
from card.simulation.mesh import Mesh
from card.simulation.raycast import Scene
from card.simulation.surfaces import LOOKS, Surface


def _found_at_centre(scene: np.ndarray, cascade: str, width: int) -> bool:
    detector = cv2.CascadeClassifier(cv2.data.haarcascades + cascade)
    boxes = detector.detectMultiScale(cv2.cvtColor(scene, cv2.COLOR_RGB2GRAY), 1.05, 2, minSize=(12, 12))
    middle = np.array([scene.shape[1], scene.shape[0]]) / 2
    return any(np.all(abs(middle - (x + w / 2, y + h / 2)) < width / 4) for x, y, w, h in boxes)


def _on_grey(texture: np.ndarray, width: int) -> np.ndarray:
    height = round(width * texture.shape[0] / texture.shape[1])
    scene = np.full((height + 2 * width, 3 * width, 3), 70, np.uint8)
    scene[: height // 2 + width] = 45
    scene[width : width + height, width : 2 * width] = cv2.resize(
        texture, (width, height), interpolation=cv2.INTER_AREA
    )
    return scene


@pytest.mark.parametrize("width", [48, 64, 120])
@pytest.mark.parametrize("index", range(6))
def test_a_haar_detector_finds_each_face(index: int, width: int) -> None:
    assert _found_at_centre(
        _on_grey(face_texture(index), width), "haarcascade_frontalface_default.xml", width
    )


@pytest.mark.parametrize("width", [60, 120, 240])
@pytest.mark.parametrize("country", ["DE", "IT"])
def test_a_haar_detector_finds_each_plate(country: str, width: int) -> None:
    for seed in range(4):
        scene = _on_grey(plate_texture(country, np.random.default_rng(seed)), width)
        assert _found_at_centre(scene, "haarcascade_russian_plate_number.xml", width), seed


@pytest.mark.parametrize("country", ["DE", "IT"])
def test_plate_keeps_its_proportions_and_its_margin(country: str) -> None:
    for seed in range(30):
        plate = plate_texture(country, np.random.default_rng(seed))
        assert plate.shape[1] / plate.shape[0] == pytest.approx(PLATE_SIZE_M[1] / PLATE_SIZE_M[0])
        right = plate[20:200, 1010:1025] if country == "DE" else plate[110:200, 965:1025]
        assert len(np.unique(right.reshape(-1, 3), axis=0)) == 1, "characters run over the edge"


def test_same_index_same_face_and_other_index_another() -> None:
    assert np.array_equal(face_texture(3), face_texture(3))
    assert not np.array_equal(face_texture(3), face_texture(5))


def test_unknown_country_is_refused() -> None:
    with pytest.raises(CardError, match=r"no number plate.*found FR, wanted DE or IT"):
        plate_texture("FR", np.random.default_rng(0))


def _drawn(
    body: Mesh, texture: np.ndarray, centre: tuple[float, float, float], angle: float, width_m: float
) -> tuple[np.ndarray, np.ndarray]:
    """A body seen from 6 m at ``angle`` to its front, and which pixels show its textured thing 0."""
    size, middle = 120, np.array(centre)
    turn = np.radians(angle)
    eye = middle + 6 * np.array([np.sin(turn), np.cos(turn), 0])
    ahead = (middle - eye) / 6
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    steps = (np.arange(3 * size) + 0.5) / (3 * size) - 0.5
    x, z = np.meshgrid(width_m * steps, -width_m * steps)
    rays = (6 * ahead + x[..., None] * right + z[..., None] * [0, 0, 1]).reshape(-1, 3)
    hits = Scene(body).cast(eye, rays / np.linalg.norm(rays, axis=1, keepdims=True))
    met = hits.triangle >= 0
    triangle = hits.triangle[met]
    albedo = np.array([LOOKS[s].albedo for s in Surface])[body.surface[triangle]] * body.tint[triangle]
    light = 0.5 + 0.5 * np.abs(hits.normal[met] @ [0.3, 0.6, 0.74])
    image = np.full((len(rays), 3), 0.55)
    image[met] = (albedo * light[:, None]) ** (1 / 2.2)
    shown = np.flatnonzero(met)[body.thing[triangle] == 0]
    corners, weights = body.uv[body.triangles[hits.triangle[shown]]], hits.barycentric[shown, :, None]
    uv = corners[:, 0] + np.sum(weights * (corners[:, 1:] - corners[:, :1]), axis=1)
    u, v = (
        np.clip(uv[:, i] * n, 0, n - 1).astype(int) for i, n in ((0, texture.shape[1]), (1, texture.shape[0]))
    )
    image[shown] = texture[v, u] / 255
    picture = np.clip(255 * image, 0, 255).astype(np.uint8).reshape(3 * size, 3 * size, 3)
    return cv2.resize(picture, (size, size), interpolation=cv2.INTER_AREA), np.isin(
        np.arange(len(rays)), shown
    )


@pytest.mark.parametrize("angle", [0, -20, 25])
def test_a_haar_detector_finds_a_walker_s_face_of_40_px(angle: float) -> None:
    scene, _ = _drawn(walker(np.full((2, 3), 0.2), 0, 0.0, 1.75), face_texture(3), (0, 0, 1.6), angle, 0.65)
    assert _found_at_centre(scene, "haarcascade_frontalface_default.xml", 60)


def test_nothing_of_a_face_is_seen_from_behind() -> None:
    _, shown = _drawn(walker(np.full((2, 3), 0.2), 0, 0.0, 1.75), face_texture(3), (0, 0, 1.6), 180, 0.65)
    assert not shown.any()


@pytest.mark.parametrize(("angle", "plates"), [(0, (0, 1)), (15, (0, 1)), (180, (1, 0))])
def test_a_haar_detector_finds_a_car_s_plate_of_60_px(angle: float, plates: tuple[int, int]) -> None:
    texture = plate_texture("DE", np.random.default_rng(2))
    height, y = (0.50, 2.2) if plates[0] == 0 else (0.70, -2.2)
    scene, _ = _drawn(car((0.3, 0.05, 0.05), plates), texture, (0, y, height), angle, 1.04)
    assert _found_at_centre(scene, "haarcascade_russian_plate_number.xml", 60)
