"""The bundle of a session, how its covariances chain, and the drift between sessions."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from survey_scene import Scene, surveyed_day

from card.artifacts import default_settings, load_schema, read_json, write_json
from card.calibration.bundle import assemble_bundle
from card.calibration.drift import measure_drift
from card.calibration.pose_covariance import chained, of_points
from card.calibration.rig_wheels import calibrate_rig_wheels
from card.calibration.state import moved, step_between
from card.calibration.take_estimated import take_estimated
from card.errors import CardError
from card.geometry import apply, from_json, inverse, to_json, transform
from card.simulation.calibrations import delivered_calibration, true_calibration
from card.simulation.drawing import write_drawing
from card.simulation.rig import WHEELS, built_rig

SETTINGS = default_settings("calibration")
SESSION, DAY = "2026-04-14-mid", "2026-04-14"
SEED = 0


def _covariance(rng: np.random.Generator, size: int, scale: float) -> np.ndarray:
    root = rng.normal(size=(size, size))
    return scale**2 * root @ root.T / size


def test_covariances_of_chains_and_points_are_those_of_their_scatter() -> None:
    rng = np.random.default_rng(1)
    one = transform([1.0, -2.0, 0.5], [0.9, 0.1, -0.3, 0.2])
    other = transform([0.3, 0.1, -1.5], [0.5, 0.5, 0.5, -0.4])
    points, noise = rng.normal(size=(3, 3)), _covariance(rng, 9, 1e-3)
    first, second = _covariance(rng, 6, 1e-3), _covariance(rng, 6, 1e-3)
    steps, moves = [], []
    for _ in range(4000):
        a = moved(one, rng.multivariate_normal(np.zeros(6), first))
        b = moved(other, rng.multivariate_normal(np.zeros(6), second))
        steps.append(step_between(one @ other, a @ b))
        p = points + rng.multivariate_normal(np.zeros(9), noise).reshape(3, 3)
        moves.append((apply(a, p) - apply(one, points)).ravel())
    for found, samples in (
        (chained(one, first, other, second), steps),
        (of_points(one, first, points, noise), moves),
    ):
        scatter = np.cov(np.array(samples).T)
        assert np.abs(found - scatter).max() < 0.1 * np.abs(scatter).max()
        np.testing.assert_allclose(found, found.T)


def _rear_and_imu(scene_seed: int) -> dict[str, Any]:
    """A session's document with the true mountings and small covariances."""
    rig = built_rig(DAY, scene_seed, 2248, 2252)
    poses = {f"rig_from_{name}": rig.rig_from[name] for name in ("lidar_front", "lidar_rear")}
    poses["lidar_front_from_lidar_rear"] = (
        inverse(poses["rig_from_lidar_front"]) @ poses["rig_from_lidar_rear"]
    )
    small = (np.diag([2e-3] * 3 + [2e-4] * 3) ** 2).tolist()
    true = true_calibration(SESSION, scene_seed, "full")["lidar_corrections"]
    document = _blank(load_schema("rear_and_imu_calibration"), load_schema("rear_and_imu_calibration"))
    document["extrinsics"] = {name: to_json(pose) for name, pose in poses.items()}
    document["covariances"] = dict.fromkeys(document["covariances"], small)
    document["corrections"] = document["sigmas"] = true
    document["imu"] |= {f"{name}_matrix": (1.001 * np.eye(3)).tolist() for name in ("gyro", "accel")}
    document["verdict"] = {"passed": False, "reasons": ["imu_sigma_mm 7, at most 6"]}
    return document


def _blank(schema: dict[str, Any], whole: dict[str, Any]) -> Any:
    """The least document that fits a schema: zeros, and as few items as it permits."""
    if "$ref" in schema:
        base, _, path = schema["$ref"].partition("#/")
        whole = load_schema(base.removeprefix("card:")) if base else whole
        found: Any = whole
        for part in path.split("/"):
            found = found[part]
        return _blank(found, whole)
    if "const" in schema:
        return schema["const"]
    if "enum" in schema:
        return schema["enum"][0]
    kind = schema["type"][0] if isinstance(schema["type"], list) else schema["type"]
    if kind == "object":
        return {name: _blank(schema["properties"][name], whole) for name in schema["required"]}
    if kind == "array":
        return [_blank(schema["items"], whole) for _ in range(schema.get("minItems", 0))]
    return {"string": "", "boolean": True, "null": None}.get(kind, schema.get("exclusiveMinimum", -1) + 1)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return surveyed_day(SEED)


def _assembled(scene: Scene, folder: Path, **changes: Any) -> dict[str, Any]:
    paths = scene.write(folder)
    calibrate_rig_wheels(**paths, settings=SETTINGS, gates=[])
    write_json(folder / "rear.json", _rear_and_imu(SEED) | changes, "rear_and_imu_calibration")
    write_drawing(folder / "drawing.json", "full")
    assemble_bundle(
        session=SESSION,
        front_lidar=paths["front_lidar"],
        rear_and_imu=folder / "rear.json",
        rig_wheels=paths["rig_wheels"],
        drawing=folder / "drawing.json",
        calibration=folder / "calibration.json",
        report=folder / "calibration.report.json",
        settings=SETTINGS,
        gates=[],
    )
    return read_json(folder / "calibration.json", "calibration")


def test_a_bundle_is_the_car(scene: Scene, tmp_path: Path) -> None:
    bundle = _assembled(scene, tmp_path)
    rig = built_rig(DAY, SEED, 2248, 2252)
    assert bundle["session"] == {"id": SESSION, "day": DAY, "mode": "estimate"}
    for name, pose in rig.rig_from.items():
        off = step_between(pose, from_json(bundle["extrinsics"][f"rig_from_{name}"]))
        sigma = np.sqrt(np.diag(bundle["covariances"][f"rig_from_{name}"]))
        assert (np.abs(off) < 5 * sigma).all(), name
    for wheel in WHEELS:
        contact = np.array(bundle["wheels"][wheel]["contact_m"])
        assert np.linalg.norm(contact - rig.wheel_contact_m[wheel]) < 4e-3
    drawing = read_json(tmp_path / "drawing.json", "drawing")
    assert bundle["camera_left_undistorted"] == drawing["camera_left_undistorted"]
    assert np.shape(bundle["covariances"]["wheels"]) == (24, 24)
    assert np.shape(bundle["covariances"]["camera_right"]) == (9, 9)
    assert bundle["imu_corrections"] == dict.fromkeys(("gyro", "accel"), (1.001 * np.eye(3)).tolist())
    assert bundle["quality"]["failed_limits"] == ["rear_and_imu: imu_sigma_mm 7, at most 6"]
    report = read_json(tmp_path / "calibration.report.json", "report")
    figures = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert figures["failed_limits"] == 1
    assert 1 < figures["sigma_wheel_contact_mm"] < 10


def test_a_bundle_of_a_car_that_looks_back_is_refused(scene: Scene, tmp_path: Path) -> None:
    turned = _rear_and_imu(SEED)["extrinsics"]
    pose = transform([0, 0, 0.1], [0, 0, 0, 1])
    with pytest.raises(CardError, match="does not look forward and upright"):
        _assembled(scene, tmp_path, extrinsics=turned | {"rig_from_lidar_front": to_json(pose)})
    assert not (tmp_path / "calibration.json").exists()


def test_an_estimated_bundle_passes_the_checks_of_a_sequence(scene: Scene, tmp_path: Path) -> None:
    bundle = _assembled(scene, tmp_path)
    gate = {"figure": "failed_limits", "unit": "1", "better": "lower", "threshold": 0}
    out = tmp_path / "out"
    out.mkdir()
    take_estimated(
        bundle=tmp_path / "calibration.json",
        session=tmp_path / "raw",
        calibration=out / "calibration.json",
        ego_mask=out / "ego_mask.png",
        report=out / "calibration.report.json",
        settings=SETTINGS,
        gates=[gate],
    )
    assert read_json(out / "calibration.json", "calibration") == bundle
    report = read_json(out / "calibration.report.json", "report")
    assert report["gates"][0]["verdict"] == "fail"
    assert report["notes"][0] == "rear_and_imu: imu_sigma_mm 7, at most 6"
    assert "has no ego_mask.png" in report["notes"][1]


def _drift(folder: Path, bundles: list[dict[str, Any]]) -> dict[str, float]:
    paths = []
    for number, bundle in enumerate(bundles):
        paths.append(folder / f"{number}.json")
        paths[-1].write_text(json.dumps(bundle))
    gate = {"figure": "drift_stereo_deg", "unit": "deg", "better": "lower", "threshold": 0.1}
    measure_drift(
        bundles=paths, drift=folder / "drift.json", report=folder / "drift.report.json", gates=[gate]
    )
    report = read_json(folder / "drift.report.json", "report")
    figures = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert report["gates"][0]["verdict"] == ("pass" if figures["drift_stereo_deg"] <= 0.1 else "fail")
    return figures


def test_drift_is_what_the_simulator_moved(tmp_path: Path) -> None:
    names = [f"{DAY}-{part}" for part in ("start", "mid", "end")]
    bundles = [true_calibration(name, 3, "demo") for name in names]
    figures = _drift(tmp_path, bundles)
    poses = [from_json(bundle["extrinsics"]["rig_from_lidar_front"]) for bundle in bundles]
    moved_mm = max(1e3 * np.linalg.norm(a[:3, 3] - b[:3, 3]) for a in poses for b in poses)
    assert figures["drift_imu_mm"] == pytest.approx(moved_mm)
    assert 0 < figures["drift_stereo_deg"] < 0.05
    assert 0 < figures["drift_focal_pct"] < 0.05
    document = read_json(tmp_path / "drift.json", "calibration_drift")
    assert [pair["sessions"] for pair in document["pairs"]] == [names[:2], names[::2], names[1:]]


def test_a_camera_that_was_knocked_fails_its_gate_and_no_other_figure(tmp_path: Path) -> None:
    start, end = (delivered_calibration(f"{DAY}-{part}", 3, "demo", views=24) for part in ("start", "end"))
    before = _drift(tmp_path, [start, end])
    knocked = from_json(end["extrinsics"]["rig_from_camera_right"]) @ transform([0, 0, 0], [1, 0.003, 0, 0])
    end["extrinsics"]["rig_from_camera_right"] = to_json(knocked)
    after = _drift(tmp_path, [start, end])
    assert after["drift_stereo_deg"] > 0.3 > before["drift_stereo_deg"]
    assert {name for name in after if abs(after[name] - before[name]) > 1e-9} == {"drift_stereo_deg"}


def test_drift_between_days_is_refused(tmp_path: Path) -> None:
    bundles = [true_calibration(f"{day}-start", 1, "demo") for day in (DAY, "2026-05-19")]
    with pytest.raises(CardError, match="bundles of several days"):
        _drift(tmp_path, bundles)
