"""CONVENTIONS.md can be executed: its program gives what the library gives."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packaging_drive import build_tree

from card.geometry import apply
from card.packaging.reader import Release

FRAME = 3


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("conventions"))


@pytest.fixture(scope="module")
def found(tree: Path) -> dict[str, Any]:
    """What the page's program leaves behind, run on the page that ships with the tree."""
    blocks = re.findall(r"```python\n(.*?)```", (tree / "CONVENTIONS.md").read_text(), re.DOTALL)
    assert blocks
    names: dict[str, Any] = {"tree": str(tree), "sequence": "de_test", "frame": FRAME}
    for block in blocks:
        exec(block, names)
    return names


def test_points_and_their_place_in_the_world(tree: Path, found: dict[str, Any]) -> None:
    release = Release(tree)
    points = release.points("de_test", FRAME)
    np.testing.assert_array_equal(found["points"], points)
    world = apply(release.transform("world_from_camera_left", "de_test", FRAME), points)
    np.testing.assert_allclose(found["in_world"], world)


def test_pixels_with_and_without_distortion(tree: Path, found: dict[str, Any]) -> None:
    release = Release(tree)
    points = release.points("de_test", FRAME)
    for camera, u, v in (("camera_left", "u_taken", "v_taken"), ("camera_left_undistorted", "u", "v")):
        pixels = release.rig("de_test").camera(camera).project(points)
        assert not np.isnan(pixels).any()
        np.testing.assert_allclose(np.stack([found[u], found[v]], axis=1), pixels)
    assert np.abs(found["u"] - found["u_taken"]).max() > 0.01


def test_the_depth_map(tree: Path, found: dict[str, Any]) -> None:
    frame = next(frame for frame in Release(tree).iterate() if frame.number == FRAME)
    depth = frame.depth()
    assert (~np.isnan(depth)).sum() == len(frame.points())
    np.testing.assert_array_equal(np.where(np.isinf(found["depth"]), np.nan, found["depth"]), depth)


def test_the_right_camera_and_the_baseline(tree: Path, found: dict[str, Any]) -> None:
    release = Release(tree)
    right = apply(
        release.transform("camera_right_from_camera_left", "de_test"), release.points("de_test", FRAME)
    )
    np.testing.assert_allclose(found["in_right"], right)
    assert found["baseline_m"] == pytest.approx(release.rig("de_test").stereo.baseline_m)
    assert (found["in_right"][:, 0] < found["points"][:, 0]).all()


def test_heights_over_the_road(tree: Path, found: dict[str, Any]) -> None:
    release = Release(tree)
    points = release.points("de_test", FRAME)
    road = apply(release.transform("road_from_camera_left", "de_test", FRAME), points)
    np.testing.assert_allclose(found["height_m"], road[:, 2])
