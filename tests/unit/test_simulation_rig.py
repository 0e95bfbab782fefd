"""The drawing of the car."""

import numpy as np
import pytest

from card.errors import CardError
from card.geometry import apply
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
