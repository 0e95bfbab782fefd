"""Formats of predictions, units, and the image that depth is predicted for."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from benchmark_release import CALIBRATION, CAMERA, EVALUATED, build_tree, predict, row, run, truth
from PIL import Image

from card.benchmark.formats import read_depth
from card.benchmark.image_space import SPACES, image_space
from card.errors import CardError
from card.geometry import CameraModel
from card.packaging.reader.rig import Rig

DEPTH = np.random.default_rng(0).uniform(1, 60, (6, 8)).astype(np.float32)
RIG = Rig(CALIBRATION)


def exr(path: Path, channels: dict[str, np.ndarray]) -> None:
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, channels) as image:
        image.write(str(path))


def png(path: Path, values: np.ndarray) -> None:
    Image.fromarray(values).save(path, format="PNG")


WRITE: dict[str, Any] = {
    "npy": lambda path: np.save(path, DEPTH),
    "npz": lambda path: np.savez_compressed(path, depth=DEPTH),
    "png": lambda path: png(path, np.rint(DEPTH * 256).astype(np.uint16)),
    "exr": lambda path: exr(path, {"Z": DEPTH}),
}


@pytest.mark.parametrize("suffix", WRITE)
def test_every_format_gives_the_same_depth(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"000001.{suffix}"
    WRITE[suffix](path)
    np.testing.assert_allclose(read_depth(path), DEPTH, atol=1 / 512 if suffix == "png" else 0)


@pytest.mark.parametrize("suffix", WRITE)
def test_a_cut_file_is_named(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"000001.{suffix}"
    WRITE[suffix](path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(CardError, match=r"000001.*unreadable prediction"):
        read_depth(path)


def test_a_declared_unit_is_applied(tmp_path: Path) -> None:
    png(tmp_path / "a.png", np.rint(DEPTH * 1000).astype(np.uint16))
    np.testing.assert_allclose(read_depth(tmp_path / "a.png", 0.001), DEPTH, atol=1e-3)
    np.save(tmp_path / "a.npy", np.rint(DEPTH * 1000).astype(np.uint16))
    np.testing.assert_allclose(read_depth(tmp_path / "a.npy", 0.001), DEPTH, atol=1e-3)


def test_a_single_array_or_channel_needs_no_name(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", DEPTH)
    exr(tmp_path / "a.exr", {"V": DEPTH})
    assert (read_depth(tmp_path / "a.npz") == DEPTH).all()
    assert (read_depth(tmp_path / "a.exr") == DEPTH).all()


WRONG = {
    "which array is the depth": ("npz", lambda path: np.savez(path, a=DEPTH, b=DEPTH)),
    "which channel is the depth": ("exr", lambda path: exr(path, {"A": DEPTH, "B": DEPTH})),
    "no 16-bit PNG .found PNG L,": ("png", lambda path: png(path, DEPTH.astype(np.uint8))),
    "no 16-bit PNG .found PNG RGB,": ("png", lambda path: png(path, np.zeros((6, 8, 3), np.uint8))),
    "no depth map .found object": ("npy", lambda path: np.save(path, np.array([None]))),
    "no depth map .found complex64": ("npy", lambda path: np.save(path, DEPTH.astype(np.complex64))),
}


@pytest.mark.parametrize("message", [name for name in WRONG if "object" not in name])
def test_other_content_is_refused(tmp_path: Path, message: str) -> None:
    suffix, write = WRONG[message]
    write(tmp_path / f"a.{suffix}")
    with pytest.raises(CardError, match=message):
        read_depth(tmp_path / f"a.{suffix}")


def test_pickled_arrays_are_not_loaded(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(CardError, match="unreadable prediction"):
        read_depth(tmp_path / "a.npy")


def plane_depth(camera: CameraModel, rotation: np.ndarray) -> np.ndarray:
    """Depth (H, W) of the plane y = 1.5 + 0.05 x - 0.02 z of camera_left, seen by a turned camera."""
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = camera.rays(np.stack([u, v], axis=-1)) @ rotation  # in camera_left
    with np.errstate(divide="ignore"):
        depth = 1.5 / (rays @ (-0.05, 1.0, 0.02))
    # Along the ray with z = 1 in its own camera.
    return np.where((depth > 0) & (depth < 200), depth, 0)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("camera", ["camera_left"])
def test_a_plane_is_the_same_plane_from_every_image(space: str, camera: str) -> None:
    where = image_space(space, RIG, camera)
    prediction = plane_depth(where.camera, where.rotation)
    v, u = np.mgrid[80:135:5, 10:130:5]
    rays = CAMERA.rays(np.stack([u, v], axis=-1)).reshape(-1, 3)
    depth, seen = where.sample(prediction, rays[:, :2])
    wanted = 1.5 / (rays @ (-0.05, 1.0, 0.02))
    near = seen & (wanted > 0) & (wanted < 60)
    assert near.sum() > 100
    np.testing.assert_allclose(depth[near], wanted[near], rtol=1e-9)


def test_gaps_stay_gaps_and_the_nearest_pixel_fills_the_rim() -> None:
    where = image_space("undistorted", RIG)
    prediction = np.zeros((where.camera.height, where.camera.width))
    prediction[50, 60] = 7.0
    pixels = np.array([[60.0, 50.0], [60.4, 50.4], [60.6, 50.0], [30.0, 30.0], [-3.0, 50.0]])
    rays = where.camera.rays(pixels)[:, :2]
    depth, seen = where.sample(prediction, rays)
    assert depth.tolist() == [7.0, 7.0, 0.0, 0.0, 0.0]
    assert seen.tolist() == [True, True, True, True, False]


@pytest.mark.parametrize("space", SPACES[1:])
def test_predictions_of_another_image_are_evaluated_at_the_same_pixels(tmp_path: Path, space: str) -> None:
    tree = build_tree(tmp_path / "release")
    where = image_space(space, RIG)
    folder = predict(tmp_path / "p")
    for sequence, frame in EVALUATED:
        (folder / sequence / f"{frame:06d}.npy").unlink()
        np.savez(folder / sequence / f"{frame:06d}.npz", plane_depth(where.camera, where.rotation))
    document = run(tree, folder, space=space)
    counts = document["counts"]
    assert 0 < counts["pixels_out_of_view"] < 0.1 * counts["pixels"]
    errors = []
    for sequence, frame in EVALUATED:
        depth = truth(sequence, frame)
        v, u = np.nonzero(np.isfinite(depth))
        rays = CAMERA.rays(np.stack([u, v], axis=1))
        seen = where.camera.contains(where.camera.project(rays @ where.rotation.T))
        plane = 1.5 / (rays @ (-0.05, 1.0, 0.02))
        # The sky has no depth; a prediction there is a failure at the near end of the range.
        plane = np.where((plane > 0) & (plane < 200), plane, 0)
        error = np.abs(np.clip(plane, 0.1, 80) - depth[v, u])[seen]
        errors.append(np.mean(error / depth[v, u][seen]))
    # Rays next to the horizon meet pixels on both sides of it.
    assert row(document, "full")["metrics"]["abs_rel"] == pytest.approx(np.mean(errors), rel=5e-3)
    assert document["space"] == space
