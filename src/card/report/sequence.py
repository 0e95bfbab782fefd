"""The figures of one sequence, drawn from its artifacts as far as its stages go."""

from collections.abc import Callable, Collection, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import read_arrays, read_json, read_table
from card.geometry import CameraModel, Roads, Trajectory, from_json
from card.report.density import draw_density
from card.report.excitation import Contact, draw_excitation
from card.report.labels import COLORS, Labels, draw_labels
from card.report.map import draw_map
from card.report.overlay import draw_overlay


@dataclass(frozen=True)
class Drawn:
    """One figure: its file and what it shows."""

    path: Path
    caption: str


def draw_sequence(folder: Path, stages: Collection[str], out: Path) -> list[Drawn]:
    """Draw a sequence's artifacts as far as its ``stages`` went, into the folder ``out``.

    folder : ``results/<id>``.
    """
    drawn = []
    for name, (needs, draw, caption) in FIGURES.items():
        path = out / f"{folder.name}-{name}.png"
        if needs <= set(stages):
            draw(folder, stages, path)
        if path.is_file():
            drawn.append(Drawn(path, caption))
    return drawn


def _overlay(folder: Path, stages: Collection[str], out: Path) -> None:
    """Draw the densest of the frames with a road plane, else of all; nothing where there is no frame."""
    from PIL import Image

    coverage = read_table(folder / "ground_truth" / "coverage.parquet", "coverage").to_pylist()
    if not coverage:
        return
    roads = (
        Roads.from_table(read_table(folder / "road_planes.parquet", "road_planes")).by_frame()
        if "wheels" in stages
        else {}
    )
    best = max(coverage, key=lambda row: (row["frame"] in roads, row["points_saved"], -row["frame"]))
    frame = int(best["frame"])
    t_ns = {row["frame"]: row["t_ns"] for row in read_table(folder / "frames.parquet", "frames").to_pylist()}
    calibration = read_json(folder / "calibration.json", "calibration")
    points = read_arrays(folder / "ground_truth" / f"{frame:06d}.npz", "ground_truth_points")["points"]
    with Image.open(folder / "anonymized" / "camera_left" / f"{t_ns[frame]}.jpg") as image:
        pixels = np.asarray(image.convert("RGB"))
    road_from_rig = roads.get(frame)
    rig_from_camera = from_json(calibration["extrinsics"]["rig_from_camera_left"])
    draw_overlay(
        out,
        frame,
        pixels,
        points,
        CameraModel.from_json(calibration["cameras"]["camera_left"]),
        None if road_from_rig is None else road_from_rig @ rig_from_camera,
    )


def _map(folder: Path, stages: Collection[str], out: Path) -> None:
    wheels = read_json(folder / "calibration.json", "calibration")["wheels"].values()
    voxels = None
    if "ground_truth" in stages:
        static = read_arrays(folder / "ground_truth" / "static_voxels.npz", "static_voxels")
        voxels = static["origin"] + (static["ids"] + 0.5) * static["voxel_size"]
    draw_map(
        out,
        Trajectory.from_table(read_table(folder / "trajectory.parquet", "trajectory")),
        -float(np.mean([wheel["contact_m"][2] for wheel in wheels])),
        voxels,
        read_table(folder / "frames.parquet", "frames")["t_ns"].to_numpy(),
        _places(folder) if "irregularities" in stages else {},
    )


def _places(folder: Path) -> dict[str, Any]:
    rows = read_table(folder / "irregularity_tracks.parquet", "irregularity_tracks").to_pylist()
    places = {
        name: np.array([[row[axis] for axis in "xyz"] for row in rows if row["class"] == name])
        for name in COLORS
    }
    return {name: place for name, place in places.items() if len(place)}


def _labels(folder: Path, stages: Collection[str], out: Path) -> None:
    boxes = read_table(folder / "labels.parquet", "labels").to_pylist()
    if not boxes:
        return
    counts = read_json(folder / "ingest.report.json", "report")["counts"]
    centre = np.array([[row["x_center"], row["y_center"]] for row in boxes])
    half = np.array([[row["width"], row["height"]] for row in boxes]) / 2
    names = np.array([row["class"] for row in boxes])
    distance = deviation = np.full(len(boxes), np.nan)
    if "irregularities" in stages:
        table = read_table(folder / "irregularities.parquet", "irregularities")
        distance, up, down = (
            table[name].to_numpy().astype(np.float64)
            for name in ("distance_m", "elevation_m", "depression_m")
        )
        deviation = np.where(names == "positive", up, -down)
    draw_labels(
        out,
        Labels(
            names,
            np.concatenate([centre - half, centre + half], axis=1),
            (counts["camera_left_width_px"], counts["camera_left_height_px"]),
            distance,
            deviation,
        ),
    )


def _excitation(folder: Path, stages: Collection[str], out: Path) -> None:
    wheels = read_json(folder / "calibration.json", "calibration")["wheels"]
    document = read_json(folder / "wheel_excitation.json", "wheel_excitation")["wheels"]
    draw_excitation(
        out,
        {
            name: Contact(
                np.array(wheel["samples"])[:, 1:4],
                np.array(wheel["gap"]) | np.array(wheel["uncertain"]),
                wheels[name]["contact_m"][1],
            )
            for name, wheel in document.items()
        },
        _places(folder) if "irregularities" in stages else {},
    )


def _density(folder: Path, stages: Collection[str], out: Path) -> None:
    coverage = read_table(folder / "ground_truth" / "coverage.parquet", "coverage")
    if coverage.num_rows:
        draw_density(out, {column: coverage[column].to_numpy() for column in coverage.column_names})


# Name of a figure: the stages it needs, what draws it, its caption.
FIGURES: Mapping[str, tuple[Set[str], Callable[[Path, Collection[str], Path], None], str]] = {
    "overlay": (
        {"ground_truth", "privacy"},
        _overlay,
        "What the camera saw, how far its ground truth is, and how high over the plane through the four "
        "wheel contacts.",
    ),
    "map": (
        {"calibration", "poses"},
        _map,
        "The drive from above: its track over the highest static voxel of each spot, and the labelled "
        "irregularities, each once.",
    ),
    "labels": (
        {"annotations"},
        _labels,
        "The labels: how many boxes cover each spot of the left image, their size against the distance of "
        "what they show, and how far the ground truth in them rises or falls.",
    ),
    "excitation": (
        {"wheels"},
        _excitation,
        "Height of the ground under each wheel over its own mean of 10 m. Stretches without LiDAR points are "
        "blank.",
    ),
    "density": (
        {"ground_truth"},
        _density,
        "Density of the ground truth, how full its windows were, and where points went.",
    ),
}
