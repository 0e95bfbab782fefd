"""Import mode of the calibration: good bundles pass whole, each kind of wrong one is named."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from card.artifacts import default_settings, read_json
from card.calibration import import_bundle
from card.errors import CardError
from card.simulation.calibrations import delivered_calibration

SESSION = "2026-04-14-start"
Document = dict[str, Any]


@pytest.fixture
def session(tmp_path: Path) -> Path:
    folder = tmp_path / "sessions" / SESSION
    folder.mkdir(parents=True)
    save(folder, delivered_calibration(SESSION, seed=1, scale="tiny", views=20))
    return folder


def save(folder: Path, bundle: Document) -> None:
    (folder / "calibration.json").write_text(json.dumps(bundle))


def run(session: Path, gates: list[Document] | None = None) -> tuple[Document, np.ndarray, Document]:
    out = session.parents[1] / "out"
    out.mkdir(exist_ok=True)
    import_bundle(
        session=session,
        calibration=out / "calibration.json",
        ego_mask=out / "ego_mask.png",
        report=out / "calibration.report.json",
        settings=default_settings("calibration"),
        gates=gates or [],
    )
    mask = cv2.imread(str(out / "ego_mask.png"), cv2.IMREAD_UNCHANGED)
    return (
        read_json(out / "calibration.json", "calibration"),
        mask,
        read_json(out / "calibration.report.json", "report"),
    )


def test_bundle_and_mask_arrive_as_delivered(session: Path) -> None:
    delivered = json.loads((session / "calibration.json").read_text())
    size = delivered["camera_left_undistorted"]
    mask = np.zeros((size["height"], size["width"]), dtype=np.uint8)
    mask[-10:, 20:40] = 255
    cv2.imwrite(str(session / "ego_mask.png"), mask)
    gate = {"figure": "stereo_reprojection_px", "unit": "px", "better": "lower", "threshold": 0.01}
    bundle, written, report = run(session, [gate])
    assert bundle == delivered
    np.testing.assert_array_equal(written, mask)
    assert report["counts"] == {"views": 20, "ego_pixels": 200}
    assert report["notes"] == []
    assert [gate["verdict"] for gate in report["gates"]] == ["fail"]
    assert {f["name"]: f["value"] for f in report["figures"]}["baseline_m"] == pytest.approx(0.6, abs=0.02)


def test_a_bundle_may_know_nothing_of_the_imu(session: Path) -> None:
    bundle = json.loads((session / "calibration.json").read_text())
    del bundle["imu_corrections"]
    save(session, bundle)
    assert "imu_corrections" not in run(session)[0]


def test_an_absent_mask_is_empty_and_noted(session: Path) -> None:
    bundle, mask, report = run(session)
    size = bundle["camera_left_undistorted"]
    assert mask.shape == (size["height"], size["width"])
    assert not mask.any()
    assert "ego_mask.png" in report["notes"][0]


def test_an_unknown_session_names_those_available(session: Path) -> None:
    with pytest.raises(CardError, match=rf"unknown calibration session 2026-04-15-mid.*{SESSION}"):
        run(session.parent / "2026-04-15-mid")


def test_a_bundle_of_another_session_is_refused(session: Path) -> None:
    other = session.rename(session.with_name("2026-04-14-mid"))
    with pytest.raises(CardError, match=r"bundle of another session.*found 2026-04-14-start"):
        run(other)


def test_a_bundle_that_does_not_fit_its_schema_is_refused(session: Path) -> None:
    bundle = json.loads((session / "calibration.json").read_text())
    del bundle["wheels"]["fl"]
    save(session, bundle)
    with pytest.raises(CardError, match=r"wheels does not fit schema calibration"):
        run(session)


def swap_cameras(bundle: Document) -> None:
    poses = bundle["extrinsics"]
    left, right = poses["rig_from_camera_left"], poses["rig_from_camera_right"]
    poses["rig_from_camera_left"], poses["rig_from_camera_right"] = right, left


def invert_camera(bundle: Document) -> None:
    pose = bundle["extrinsics"]["rig_from_camera_left"]
    w, *xyz = pose["rotation_wxyz"]
    pose["rotation_wxyz"] = [w, *(-v for v in xyz)]


def scale_rotation(bundle: Document) -> None:
    pose = bundle["extrinsics"]["rig_from_lidar_rear"]
    pose["rotation_wxyz"] = [1.01 * v for v in pose["rotation_wxyz"]]


def shrink_right_image(bundle: Document) -> None:
    bundle["cameras"]["camera_right"]["width"] -= 1


def move_principal_point(bundle: Document) -> None:
    bundle["cameras"]["camera_left"]["cx"] = -3.0


def swap_wheels(bundle: Document, one: str, other: str) -> None:
    wheels = bundle["wheels"]
    wheels[one], wheels[other] = wheels[other], wheels[one]


def contact_over_center(bundle: Document) -> None:
    wheel = bundle["wheels"]["rr"]
    wheel["contact_m"], wheel["center_m"] = wheel["center_m"], wheel["contact_m"]


def wheels_in_centimetres(bundle: Document) -> None:
    for wheel in bundle["wheels"].values():
        for point in ("center_m", "contact_m"):
            wheel[point] = [100 * v for v in wheel[point]]


def range_in_millimetres(bundle: Document) -> None:
    bundle["lidar_corrections"]["lidar_front"]["range_offset_m"] = 0.08


def angles_in_degrees(bundle: Document) -> None:
    bundle["lidar_corrections"]["lidar_rear"]["channel_elevation_offset_rad"][7] = -0.3


def imu_in_per_cent(bundle: Document) -> None:
    bundle["imu_corrections"]["gyro"][1][1] = 1.2


def imu_transposed(bundle: Document) -> None:
    bundle["imu_corrections"]["accel"] = np.transpose(bundle["imu_corrections"]["accel"]).tolist()


def negative_variance(bundle: Document) -> None:
    bundle["covariances"]["rig_from_lidar_front"][2][2] = -1e-6


def lopsided_covariance(bundle: Document) -> None:
    bundle["covariances"]["rig_from_lidar_front"][0][1] = 1e-7


BAD: list[tuple[Callable[[Document], None], str]] = [
    (swap_cameras, r"right camera is not at the right of the left one \(found x -0\.\d+ m"),
    (invert_camera, "rig_from_camera_left does not look forward and upright.*inverted"),
    (scale_rotation, "rig_from_lidar_rear has no unit quaternion.*norm 1.010000"),
    (shrink_right_image, "cameras differ in size"),
    (move_principal_point, "camera_left has its principal point outside the image"),
    (lambda bundle: swap_wheels(bundle, "fl", "fr"), "wheel fr is not right of fl"),
    (lambda bundle: swap_wheels(bundle, "fl", "rl"), "wheel fl is not ahead of rl"),
    (contact_over_center, "contact of wheel rr is not a radius below its center.*found -0"),
    (wheels_in_centimetres, "implausible track between wheels fl and fr"),
    (range_in_millimetres, r"range_offset_m of lidar_front out of range \(found 0.08"),
    (angles_in_degrees, r"channel_elevation_offset_rad of channel 7 of lidar_rear out of range \(found -0.3"),
    (
        imu_in_per_cent,
        r"imu_corrections of gyro out of range in row 1, column 1 \(found 1.2, wanted 1 within",
    ),
    (imu_transposed, "imu_corrections of accel are not upper triangular"),
    (negative_variance, "covariance of rig_from_lidar_front is not positive semidefinite"),
    (lopsided_covariance, "covariance of rig_from_lidar_front is not symmetric"),
]


@pytest.mark.parametrize(("spoil", "message"), BAD)
def test_a_bundle_that_cannot_be_true_is_refused(
    session: Path, spoil: Callable[[Document], None], message: str
) -> None:
    bundle = json.loads((session / "calibration.json").read_text())
    spoil(bundle)
    save(session, bundle)
    with pytest.raises(CardError, match=message):
        run(session)
    assert not (session.parents[1] / "out" / "calibration.json").exists()


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.zeros((8, 9), dtype=np.uint8), r"ego mask of the wrong size \(found 9 x 8"),
        (None, "unreadable ego mask"),
        ("grey", "ego mask has other values.*128"),
        ("colour", "one channel"),
    ],
)
def test_a_wrong_mask_is_refused(session: Path, mask: Any, message: str) -> None:
    size = json.loads((session / "calibration.json").read_text())["camera_left_undistorted"]
    shape = (size["height"], size["width"])
    if isinstance(mask, str):
        mask = np.full(shape if mask == "grey" else (*shape, 3), 128, dtype=np.uint8)
    if mask is None:
        (session / "ego_mask.png").write_bytes(b"no picture")
    else:
        cv2.imwrite(str(session / "ego_mask.png"), mask)
    with pytest.raises(CardError, match=message):
        run(session)
