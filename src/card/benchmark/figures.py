"""The figures of a comparison: error against distance, height error maps, a sheet for a box of each class."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import atomic_folder, read_json, read_table
from card.benchmark.distance_figure import draw_distance
from card.benchmark.frames import Loaded, Method, SequenceView, SequenceViews, key, load, select
from card.benchmark.pictures import Maps, crop_of, largest_boxes, predicted_maps, truth_maps
from card.benchmark.sheet import draw_heights, draw_sheet
from card.packaging.reader import Release


def draw_figures(
    *, release: Path, split: str, methods: Sequence[Method], evaluations: Sequence[Path], out: Path
) -> None:
    """Draw the figures of methods and their evaluations of the same split.

    out : folder with ``distance.png`` and, for a release with images, road planes and boxes,
    ``heights-<class>.png`` and ``sheet-<class>.png`` of the box with the most ground truth of each class.
    """
    documents = [read_json(folder / "evaluation.json", "evaluation") for folder in evaluations]
    opened = Release(release)
    rows = {key(row): row for row in opened.frames(split)}
    boxes = [
        row
        for row in read_table(evaluations[0] / "boxes.parquet", "evaluation_boxes").to_pylist()
        if rows[key(row)]["has_camera_left"]
    ]
    with atomic_folder(out) as partial:
        draw_distance(partial / "distance.png", documents)
        for name, box in sorted(largest_boxes(boxes).items()):
            _draw_box(partial, name, box, rows[key(box)], opened, split, methods, documents)


def _draw_box(
    folder: Path,
    name: str,
    box: Mapping[str, Any],
    row: Mapping[str, Any],
    release: Release,
    split: str,
    methods: Sequence[Method],
    documents: Sequence[Mapping[str, Any]],
) -> None:
    settings = documents[0]["settings"]
    scaled = {document["method"]: document["task"] == "depth" for document in documents}
    frames: dict[str, tuple[Loaded, SequenceView]] = {}
    for method in methods:
        path = select(release, split, method, settings["coverage_flags"]).files[key(row)]
        view = SequenceViews(release, method.space).of(row["sequence"])
        frames[method.name] = load(release, row, path, method, view), view
    frame, view = next(iter(frames.values()))
    size = (view.view.camera.width, view.view.camera.height)
    image = release.image(*key(row))
    label = frame.boxes[box["box"]][1:]
    whole = (slice(0, size[1]), slice(0, size[0]))
    title = f"{name.capitalize()} irregularity: {row['sequence']}, frame {row['frame']}"
    for span, draw in ((crop_of(label, *size), "sheet"), (whole, "heights")):
        truth = truth_maps(frame, view, span, settings)
        maps: dict[str, Maps] = {
            method: predicted_maps(loaded, its_view, span, settings, scaled[method])
            for method, (loaded, its_view) in frames.items()
        }
        path = folder / f"{draw}-{name}.png"
        if draw == "sheet":
            draw_sheet(
                path, f"{title}; depth methods scaled to the truth's median", image, label, span, truth, maps
            )
        else:
            draw_heights(path, title, image, truth, maps, settings["height_thresholds_m"][1])
