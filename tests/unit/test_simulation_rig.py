"""The drawing of the car."""

from pathlib import Path

import numpy as np
import pytest

from card.artifacts import read_json
from card.errors import CardError
from card.geometry import CameraModel, apply, from_json, inverse
from card.simulation.drawing import write_drawing
from card.simulation.rig import LIDARS, built_rig, lidar_elevations_rad, nominal_rig
from card.simulation.scales import SCALES, scale_named


def test_sensors_look_where_the_drawing_says() -> None:
    rig = nominal_rig(562, 563)
    for pose in rig.rig_from.values():
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    ahead = rig.rig_from["camera_left"][:3, 2]
    assert ahead[1] > 0.99
    assert rig.rig_from["camera_left"][2, 1] < -0.99  # image rows run down
    assert rig.rig_from["lidar_rear"][1, 1] < -0.9  # the rear unit's y looks back
    for lidar in LIDARS:
        assert rig.rig_from[lidar][2, 2] > 0.9


def test_seventy_degrees_across_and_undistortable_at_every_corner() -> None:
    camera = nominal_rig(562, 563).cameras["camera_left"]
    corners = [[0, 0], [561, 0], [0, 562], [561, 562]]
    rays = camera.rays(corners)
    np.testing.assert_allclose(camera.project(rays), corners, atol=1e-6)
    edge = camera.undistorted().rays([[561.5, camera.cy]])[0]
    assert np.degrees(np.arctan(edge[0])) == pytest.approx(35.0, abs=0.1)


def test_the_same_day_gives_the_same_car_at_every_image_size() -> None:
    small, large = built_rig("2026-04-14", 1, 140, 140), built_rig("2026-04-14", 1, 562, 562)
    for name in small.rig_from:
        np.testing.assert_array_equal(small.rig_from[name], large.rig_from[name])
    left_small, left_large = small.cameras["camera_left"], large.cameras["camera_left"]
    assert left_large.fx / left_small.fx == pytest.approx(562 / 140)
    other = built_rig("2026-05-19", 1, 140, 140)
    assert not np.allclose(other.rig_from["lidar_rear"], small.rig_from["lidar_rear"], atol=1e-5)


def test_built_car_stays_near_its_drawing() -> None:
    drawn, built = nominal_rig(140, 140), built_rig("2026-04-14", 3, 140, 140)
    probe = np.array([[0.0, 10.0, 0.0]])
    for name, pose in drawn.rig_from.items():
        assert np.linalg.norm(apply(pose, probe) - apply(built.rig_from[name], probe)) < 0.25


def test_the_drawing_tells_what_is_drawn_and_how_far_off_cars_are_built(tmp_path: Path) -> None:
    write_drawing(tmp_path / "drawing.json", "demo")
    drawing = read_json(tmp_path / "drawing.json", "drawing")
    left = CameraModel.from_json(drawing["cameras"]["camera_left"])
    assert left == nominal_rig(562, 563).cameras["camera_left"]
    assert CameraModel.from_json(drawing["camera_left_undistorted"]) == left.undistorted()
    metres, radians = [], []
    for seed in range(30):
        built = built_rig("2026-04-14", seed, 562, 563)
        for name, pose in built.rig_from.items():
            drawn = drawing["extrinsics"][f"rig_from_{name}"]
            offset = inverse(from_json(drawn)) @ pose
            metres.extend(offset[:3, 3] / drawn["sigma_m"])
            radians.extend(offset[[2, 0, 1], [1, 2, 0]] / drawn["sigma_rad"])
        for wheel, drawn in drawing["wheels"].items():
            metres.extend((built.wheel_contact_m[wheel] - drawn["contact_m"]) / drawn["sigma_m"])
    assert np.std(metres) == pytest.approx(1, abs=0.1)
    assert np.std(radians) == pytest.approx(1, abs=0.1)


def test_elevations_run_from_top_to_bottom() -> None:
    degrees = np.degrees(lidar_elevations_rad())
    assert degrees[0] == pytest.approx(15)
    assert degrees[31] == pytest.approx(-16)


def test_scales() -> None:
    for scale in SCALES.values():
        assert scale.camera_start_s + scale.camera_duration_s < scale.duration_s
        assert 36000 % scale.columns == 0  # whole hundredths of a degree, as packets carry them
    with pytest.raises(CardError, match="unknown scale"):
        scale_named("huge")
