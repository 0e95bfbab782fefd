"""Labels against a ground truth whose bumps and holes are known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from schema_rows import columns

from card.artifacts import default_settings, read_json, read_table, write_arrays, write_json, write_table
from card.geometry import CameraModel, Trajectory, apply, from_json, inverse
from card.irregularities.ground import fit_ground
from card.irregularities.link import link_irregularities
from card.irregularities.profile import View, box_profile
from card.irregularities.tracks import track_boxes
from card.simulation.calibrations import true_calibration

CALIBRATION = true_calibration("2026-04-14-start", 0, "demo")
CAMERA = CameraModel.from_json(CALIBRATION["cameras"]["camera_left"])
CAMERA_FROM_RIG = inverse(from_json(CALIBRATION["extrinsics"]["rig_from_camera_left"]))
GROUND_Z = float(np.mean([wheel["contact_m"][2] for wheel in CALIBRATION["wheels"].values()]))
STEP_M = 1.5
SETTINGS = default_settings("irregularities")

BUMP, HOLE, PATCH = (0.0, 24.0, 0.06), (-1.2, 19.0, -0.05), (1.0, 17.0, 0.0)
"""x and y in world, height; a patch of paint is neither."""


def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height over the crowned, sloping road."""
    z = -0.02 * (x / 3.5) ** 2 + 0.01 * y
    z = z + BUMP[2] * np.cos(np.pi / 2 * np.clip((y - BUMP[1]) / 0.5, -1, 1)) ** 2 * (np.abs(x) < 3)
    inside = np.hypot((x - HOLE[0]) / 0.4, (y - HOLE[1]) / 0.6)
    return z + HOLE[2] * np.clip(4 * (1 - inside), 0, 1)


def road_points(frame: int, noise_m: float = 0.004) -> np.ndarray:
    """Points in rig of a frame whose rig stands at y = STEP_M * frame, parallel to the world."""
    rng = np.random.default_rng(frame)
    x, y = rng.uniform(-4, 4, 60_000), rng.uniform(3, 30, 60_000)
    y_world = y + STEP_M * frame
    z = surface(x, y_world) - 0.01 * STEP_M * frame + GROUND_Z
    wall = np.stack(
        [rng.uniform(-4, 4, 3000), np.full(3000, 30.0), rng.uniform(0, 3, 3000) + GROUND_Z], axis=1
    )
    return np.concatenate([np.stack([x, y, z + rng.normal(0, noise_m, x.size)], axis=1), wall])


def label(
    frame: int, name: str, centre: tuple[float, float, float], half: tuple[float, float]
) -> dict[str, Any]:
    """The box around a rectangle of the road in the image of a frame."""
    u, v = np.meshgrid(np.linspace(-1, 1, 21), np.linspace(-1, 1, 21))
    x, y = centre[0] + half[0] * u.ravel(), centre[1] + half[1] * v.ravel()
    z = surface(x, y) - 0.01 * STEP_M * frame + GROUND_Z
    rig = np.stack([x, y - STEP_M * frame, z], axis=1)
    pixels = CAMERA.project(apply(CAMERA_FROM_RIG, rig))
    size = np.array([CAMERA.width, CAMERA.height])
    low, high = (pixels.min(axis=0) + 0.5) / size, (pixels.max(axis=0) + 0.5) / size
    mean, extent = ((low + high) / 2).tolist(), (high - low).tolist()
    return {
        "frame": frame,
        "class": name,
        "x_center": mean[0],
        "y_center": mean[1],
        "width": extent[0],
        "height": extent[1],
    }


def write_drive(folder: Path, labels: list[dict[str, Any]], frames: int = 4, valid: bool = True) -> None:
    write_json(folder / "calibration.json", CALIBRATION, "calibration")
    t_ns = np.arange(0, (frames + 1) * 100_000_000, 10_000_000)
    track = np.stack([0 * t_ns, STEP_M * t_ns / 1e8, 0.01 * STEP_M * t_ns / 1e8], axis=1)
    poses = Trajectory(t_ns, track, np.tile([1.0, 0, 0, 0], (t_ns.size, 1)))
    write_table(folder / "trajectory.parquet", poses.to_table(), "trajectory")
    rows = [{"frame": n, "t_ns": n * 100_000_000} for n in range(frames)]
    write_table(folder / "frames.parquet", columns("frames", rows), "frames")
    road = {"normal_z": 1.0, "offset_m": -GROUND_Z, "z": -GROUND_Z, "qw": 1.0, "valid": valid}
    road |= dict.fromkeys(("normal_x", "normal_y", "x", "y", "qx", "qy", "qz"), 0.0)
    write_table(
        folder / "road_planes.parquet", columns("road_planes", [r | road for r in rows]), "road_planes"
    )
    for frame in range(frames):
        points = apply(CAMERA_FROM_RIG, road_points(frame)).astype(np.float32)
        path = folder / "ground_truth" / f"{frame:06d}.npz"
        write_arrays(path, {"points": points}, "ground_truth_points")
    write_table(folder / "labels.parquet", columns("labels", labels), "labels")


def run(folder: Path, **settings: Any) -> tuple[list[dict], list[dict], dict]:
    link_irregularities(
        **{name: folder / f"{name}.parquet" for name in ("labels", "frames", "trajectory", "road_planes")},
        calibration=folder / "calibration.json",
        ground_truth=folder / "ground_truth",
        irregularities=folder / "irregularities.parquet",
        tracks=folder / "irregularity_tracks.parquet",
        report=folder / "irregularities.report.json",
        settings=SETTINGS | settings,
        gates=[],
    )
    return (
        read_table(folder / "irregularities.parquet", "irregularities").to_pylist(),
        read_table(folder / "irregularity_tracks.parquet", "irregularity_tracks").to_pylist(),
        read_json(folder / "irregularities.report.json", "report"),
    )


def test_bump_and_hole_agree_and_are_where_they_are(tmp_path):
    labels = [
        row
        for frame in range(4)
        for row in (
            label(frame, "positive", BUMP, (3.0, 0.5)),
            label(frame, "negative", HOLE, (0.4, 0.6)),
        )
    ]
    write_drive(tmp_path, labels)
    boxes, tracks, report = run(tmp_path)
    assert [box["verdict"] for box in boxes] == ["agrees"] * 8
    assert [(t["class"], t["boxes"], t["first_frame"], t["last_frame"]) for t in tracks] == [
        ("positive", 4, 0, 3),
        ("negative", 4, 0, 3),
    ]
    for track, thing in zip(tracks, (BUMP, HOLE), strict=True):
        assert abs(track["y"] - thing[1]) < 0.15
        assert abs(track["x"] - thing[0]) < (0.6 if thing is BUMP else 0.15)
        # The world's z follows the slope that the trajectory drives up.
        assert track["z"] == pytest.approx(surface(*map(np.array, thing[:2])) + GROUND_Z, abs=0.04)
    assert tracks[0]["elevation_m"] == pytest.approx(BUMP[2], abs=0.015)
    assert tracks[1]["depression_m"] == pytest.approx(-HOLE[2], abs=0.015)
    assert [box["distance_m"] for box in boxes[1::2]] == sorted(
        (b["distance_m"] for b in boxes[1::2]), reverse=True
    )
    assert report["counts"]["positive_agrees"] == report["counts"]["negative_agrees"] == 4
    assert {f["name"]: f["value"] for f in report["figures"]} == {
        "boxes_judged_pct": 100,
        "boxes_agreeing_pct": 100,
    }


def test_heights_are_those_over_the_road_plane(tmp_path):
    write_drive(tmp_path, [label(0, "negative", HOLE, (0.4, 0.6))], frames=1)
    (box,), _, _ = run(tmp_path)
    x, y = np.meshgrid(np.linspace(-1.6, -0.8, 80), np.linspace(18.4, 19.6, 80))
    truth = surface(x, y)
    assert box["height_min_m"] == pytest.approx(truth.min(), abs=0.02)
    assert box["height_max_m"] == pytest.approx(truth.max(), abs=0.02)
    assert box["relief_m"] == pytest.approx(box["height_max_m"] - box["height_min_m"])
    assert box["points"] > 100


@pytest.mark.parametrize(
    ("name", "thing", "half"),
    [
        ("positive", HOLE, (0.4, 0.6)),
        ("negative", BUMP, (3.0, 0.5)),
        ("positive", PATCH, (0.5, 0.5)),
        ("negative", PATCH, (0.5, 0.5)),
    ],
)
def test_a_box_that_the_ground_truth_contradicts_is_listed(tmp_path, name, thing, half):
    write_drive(tmp_path, [label(0, name, thing, half)], frames=1)
    boxes, tracks, report = run(tmp_path)
    assert boxes[0]["verdict"] == "doubtful"
    assert tracks[0]["doubtful"] == 1
    wanted = "elevation" if name == "positive" else "depression"
    assert [f"{name} without {wanted}" in note for note in report["notes"]] == [True]


def test_a_crown_is_no_elevation(tmp_path):
    write_drive(tmp_path, [label(0, "positive", (0.0, 15.0, 0.0), (3.0, 0.6))], frames=1)
    boxes, _, _ = run(tmp_path)
    assert boxes[0]["verdict"] == "doubtful"


def test_without_points_the_verdict_is_unknown_and_the_place_is_on_level_ground(tmp_path):
    write_drive(tmp_path, [label(0, "negative", HOLE, (0.4, 0.6))], frames=1)
    (tmp_path / "ground_truth" / "000000.npz").unlink()
    (box,), (track,), _ = run(tmp_path)
    assert (box["verdict"], box["points"], box["relief_m"]) == ("unknown", 0, None)
    # Level ground is 19 cm too low for a road that rises.
    assert (track["x"], track["y"]) == (pytest.approx(HOLE[0], abs=0.3), pytest.approx(HOLE[1], abs=3))


def test_a_box_over_the_horizon_has_no_place(tmp_path):
    sky = {"frame": 0, "class": "positive", "x_center": 0.5, "y_center": 0.1, "width": 0.1, "height": 0.1}
    write_drive(tmp_path, [sky], frames=1)
    (box,), tracks, report = run(tmp_path)
    assert (box["track"], box["x"], box["distance_m"], tracks) == (None, None, None, [])
    assert report["counts"]["boxes_without_place"] == 1


def test_without_a_valid_road_plane_there_are_no_heights_but_a_verdict(tmp_path):
    write_drive(tmp_path, [label(0, "negative", HOLE, (0.4, 0.6))], frames=1, valid=False)
    (box,), _, _ = run(tmp_path)
    assert (box["height_max_m"], box["relief_m"], box["verdict"]) == (None, None, "agrees")


def test_no_labels_give_empty_tables(tmp_path):
    write_drive(tmp_path, [], frames=1)
    boxes, tracks, report = run(tmp_path)
    assert (boxes, tracks) == ([], [])
    assert all(figure["value"] is None for figure in report["figures"])


def test_same_inputs_same_bytes(tmp_path):
    write_drive(tmp_path, [label(0, "negative", HOLE, (0.4, 0.6))], frames=1)
    names = ("irregularities.parquet", "irregularity_tracks.parquet", "irregularities.report.json")
    made = []
    for _ in range(2):
        run(tmp_path)
        made.append([(tmp_path / name).read_bytes() for name in names])
    assert made[0] == made[1]


def test_ground_is_not_bent_by_a_third_that_sticks_out():
    rng = np.random.default_rng(2)
    points = rng.uniform((-2, 5, 0), (2, 9, 0), (600, 3))
    points[:, 2] = 0.03 * points[:, 0] - 0.01 * points[:, 1] - 0.004 * points[:, 0] ** 2 - 1.7
    clean = fit_ground(points)
    assert np.abs(clean.above(points)).max() < 1e-9
    bent = points + np.where(np.arange(600)[:, None] % 3 == 0, (0, 0, 0.15), 0)
    assert np.abs(fit_ground(bent).above(points)).max() < 1e-3


def tracked(rows: list[tuple[int, str, float, float, float]], spread: float = 0.0) -> list[int]:
    frames, names, x, y, distances = zip(*rows, strict=True)
    spreads = np.full(len(rows), spread)
    places = np.array([x, y]).T
    return track_boxes(frames, names, places, np.array(distances), spreads, 1.0, 0.05).tolist()


def test_parts_of_a_wide_bump_are_one():
    rows = [(0, "positive", 0, 0, 5), (1, "positive", 3, 0, 5)]
    assert tracked(rows) == [0, 1]
    assert tracked(rows, spread=2.5) == [0, 0]


def test_a_box_at_the_images_edge_is_not_judged_by_a_guessed_ground(tmp_path):
    """Only the ground behind it is in sight: a crown and a slope would be guessed."""
    near = label(0, "positive", (0.0, 8.0, 0.0), (3.0, 2.0))
    write_drive(tmp_path, [near], frames=1)
    rig = road_points(0)
    in_view = apply(CAMERA_FROM_RIG, rig[rig[:, 1] > 7]).astype(np.float32)
    write_arrays(tmp_path / "ground_truth" / "000000.npz", {"points": in_view}, "ground_truth_points")
    (box,), (track,), _ = run(tmp_path)
    assert (box["verdict"], box["elevation_m"]) == ("unknown", None)
    assert box["points"] > 100
    assert track["y"] == pytest.approx(8, abs=2)


@pytest.mark.parametrize(("share", "verdict"), [(0.0, "agrees"), (0.03, "agrees"), (0.3, "unknown")])
def test_a_box_with_something_else_on_the_road_is_not_judged(share, verdict):
    """A bump of 6 cm, seen straight from above, on a share of which something half a metre high stands."""
    rng = np.random.default_rng(3)
    rig = rng.uniform((-4, 5, 0), (4, 13, 0), (20_000, 3))
    on_bump = (np.abs(rig[:, 0]) < 2) & (np.abs(rig[:, 1] - 9) < 2)
    rig[on_bump, 2] += 0.06
    rig[on_bump & (rng.uniform(size=len(rig)) < share), 2] += 0.5
    view = View(rig[:, :2], rig, rig[:, 2])
    profile = box_profile(view, np.array([-2.0, 7.0, 2.0, 11.0]), "positive", SETTINGS)
    assert profile.verdict == verdict
    assert profile.elevation_m == (pytest.approx(0.06, abs=1e-3) if verdict == "agrees" else None)
    assert profile.place == pytest.approx([0, 9, 0.06], abs=0.1)


def test_two_things_in_one_frame_are_never_one():
    rows = [(0, "negative", 0, 0, 5), (0, "negative", 0.5, 0, 5), (1, "negative", 0.1, 0, 4)]
    assert tracked(rows) == [0, 1, 0]


def test_classes_are_never_mixed_and_missing_places_have_no_track():
    rows = [(0, "negative", 0, 0, 5), (1, "positive", 0, 0, 5), (2, "negative", np.nan, np.nan, np.nan)]
    assert tracked(rows) == [0, 1, -1]


def test_what_is_far_may_be_off_by_more():
    rows = [(0, "negative", 2.5, 0, 40), (5, "negative", 0, 0, 4), (6, "negative", 2.5, 0, 4)]
    assert tracked(rows) == [0, 1, 0]
    assert tracked([(0, "negative", 2.5, 0, 4), (5, "negative", 0, 0, 4)]) == [0, 1]


def test_a_second_visit_finds_the_same_thing():
    assert tracked([(0, "positive", 0, 0, 5), (900, "positive", 0.4, 0.3, 6)]) == [0, 0]
