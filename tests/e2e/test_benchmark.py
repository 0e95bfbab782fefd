"""The benchmark on a built release: three references made of its truth, in the order they deserve."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import yaml
from project import Project
from scipy.ndimage import distance_transform_edt, gaussian_filter

from card.geometry import quaternion_from_matrix, rasterize
from card.packaging.reader import Release

REPOSITORY = "card-italy"
NOISE = np.random.default_rng(0)
#: From good to bad once the scale is taken out; the first is right but for its scale.
REFERENCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "scaled": lambda depth: 1.05 * depth,
    "smoothed": lambda depth: np.exp(gaussian_filter(np.log(depth), 2.0)),
    "noise": lambda depth: depth * np.exp(NOISE.normal(0, 0.4, depth.shape)),
}


def filled(depth: np.ndarray) -> np.ndarray:
    """Depth (H, W) with every gap taken from the nearest pixel."""
    _, (row, column) = distance_transform_edt(np.isnan(depth), return_indices=True)
    return depth[row, column]


def write_references(release: Release, folder: Path) -> None:
    for row in release.frames("test"):
        camera = release.rig(row["sequence"]).camera("camera_left")
        truth = filled(rasterize(release.points(row["sequence"], row["frame"]), camera))
        for name, change in REFERENCES.items():
            path = folder / name / REPOSITORY / row["sequence"] / f"{row['frame']:06d}.npz"
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savez(path, depth=change(truth).astype(np.float32))


def write_trajectories(release: Release, folder: Path) -> None:
    """The released poses themselves, as a method would write them."""
    folder.mkdir(parents=True)
    for sequence in {row["sequence"] for row in release.frames("zero_shot")}:
        lines = []
        for pose in release.poses(sequence):
            if pose["sensor"] == "camera_left":
                matrix = release.transform("world_from_camera_left", sequence, pose["index"])
                w, x, y, z = quaternion_from_matrix(matrix[:3, :3])
                values = " ".join(f"{value:.9f}" for value in (*matrix[:3, 3], x, y, z, w))
                lines.append(f"{pose['t_ns'] // 10**9}.{pose['t_ns'] % 10**9:09d} {values}")
        (folder / f"{sequence}.txt").write_text("\n".join(lines) + "\n")


def test_the_benchmark_ranks_references_made_of_the_release(built: Project, tmp_path: Path) -> None:
    release = Release(built.root / "results" / "release" / REPOSITORY)
    write_references(release, tmp_path)
    write_trajectories(release, tmp_path / "replay" / REPOSITORY)
    methods = {name: {"predictions": str(tmp_path / name)} for name in REFERENCES}
    methods["completed"] = {"predictions": str(tmp_path / "smoothed"), "task": "completion"}
    methods["replay"] = {"predictions": str(tmp_path / "replay"), "task": "odometry"}
    flags = "  coverage_flags: [complete, cut]\n"
    with built.changed("config/config.yaml", flags, f"{flags}  methods: {json.dumps(methods)}\n"):
        assert (
            yaml.safe_load((built.root / "config" / "config.yaml").read_text())["benchmark"]["methods"]
            == methods
        )
        built.build("benchmark")

    results = built.root / "results" / "benchmark"
    comparison = json.loads((results / REPOSITORY / "comparison.json").read_text())
    assert comparison["findings"] == []
    tables = {table["name"]: table for table in comparison["tables"]}
    assert set(tables) >= {"depth", "depth_scaled", "height_scaled", "completion", "completion_without_input"}
    for name in ("depth_scaled", "height_scaled"):
        assert [row["method"] for row in tables[name]["methods"]] == list(REFERENCES)
        values = np.array([row["values"] for row in tables[name]["methods"]], dtype=float)
        for key, column in zip(tables[name]["columns"], values.T, strict=True):
            steps = np.diff(column) * (-1 if "delta" in key else 1)
            assert (steps >= 0).all(), (name, key, column)
            if "delta" not in key:
                assert (steps > 0).all(), (name, key, column)
    raw = dict(zip(tables["depth"]["columns"], tables["depth"]["methods"][0]["values"], strict=True))
    assert abs(raw["abs_rel/full"] - 0.05) < 1e-4
    figures = {path.name for path in (results / REPOSITORY / "figures").glob("*.png")}
    assert figures >= {"distance.png", "sheet-positive.png", "heights-positive.png"}
    odometry = json.loads((results / "replay" / REPOSITORY / "odometry.json").read_text())
    assert odometry["counts"]["sequences"] == 1
    assert odometry["mean"]["ate_rmse_m"] < 1e-6
