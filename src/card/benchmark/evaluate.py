"""Stage `benchmark`: score a method's depth maps on one split of a release."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import atomic_folder, progress, write_json, write_report
from card.benchmark.completion import input_pixels, sparse_depth
from card.benchmark.frame_scores import (
    INPUT_PIXELS,
    SCALINGS,
    Evaluated,
    FrameScores,
    frame_scores,
)
from card.benchmark.frames import (
    CLASSES,
    Loaded,
    Method,
    Selection,
    SequenceView,
    SequenceViews,
    each_frame,
    evaluated,
    key,
    load,
    select,
)
from card.benchmark.pixel_metrics import SUMS, median_scale
from card.benchmark.plausible import PROBES, check_camera, check_unit
from card.benchmark.results import Results
from card.benchmark.tables import markdown
from card.packaging.reader import Frame, Release

#: Completion is metric: its input gives the scale.
TASKS = {"depth": (SCALINGS, INPUT_PIXELS[:1]), "completion": (SCALINGS[:1], INPUT_PIXELS)}


def evaluate(
    *,
    release: Path,
    split: str,
    method: Method,
    task: str,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Score the depth maps of one method, and return the document `evaluation`.

    Parameters
    ----------
    release : tree of a release; split : one of its splits.
    task : ``depth``: full images and boxes, as predicted and scaled to the truth's median. ``completion``: as
        predicted, with and without the pixels whose truth is the sweep that was the input.
    out : folder with ``evaluation.json``, ``table.md``, ``frames.parquet``, ``boxes.parquet`` and
        ``distances.parquet``.

    CardError for missing or extra predictions, files that cannot be read, a wrong size, infinite or negative
    depth, another unit or another camera than declared.
    """
    opened = Release(release)
    selection = select(opened, split, method, settings["coverage_flags"])
    views = SequenceViews(opened, method.space)
    _check_plausible(opened, selection, method, views, settings)

    scalings, variants = TASKS[task]
    results = Results(scalings, settings)
    counts = dict.fromkeys(("boxes", "empty_boxes", "pixels", "pixels_out_of_view", "frames_without_road"), 0)

    def score(frame: Loaded, view: SequenceView) -> tuple[Loaded, int, dict[str, FrameScores]]:
        given, unseen = evaluated(frame, view, settings)
        size = (view.view.camera.width, view.view.camera.height)
        found = {}
        for variant in variants:
            part = given if variant == "all" else given.part(_not_input(opened, frame, given, settings))
            found[variant] = frame_scores(part, [box[1:] for box in frame.boxes], size, scalings, settings)
        return replace(frame, prediction=None), unseen, found

    scored = each_frame(opened, selection, method, views, score)
    for frame, unseen, found in progress(scored, "evaluate", len(selection.rows)):
        for variant, scores in found.items():
            results.add(frame.row, [CLASSES[int(box[0])] for box in frame.boxes], scores, variant)
        counts["boxes"] += len(frame.boxes)
        counts["empty_boxes"] += int(np.count_nonzero(np.isnan(found["all"].box_depth)))
        counts["pixels"] += int(found["all"].full[0, SUMS.index("truth")])
        counts["pixels_out_of_view"] += unseen
        counts["frames_without_road"] += frame.road_from_camera is None

    document = {
        "schema": "evaluation",
        "task": task,
        "method": method.name,
        "space": method.space,
        "repository": opened.about["repository"],
        "version": opened.about["version"],
        "split": split,
        "settings": {name: value for name, value in settings.items() if name not in ("methods", "split")},
        "counts": {
            "sequences": len({row["sequence"] for row in selection.rows}),
            "frames": len(selection.rows),
            "frames_without_truth": selection.without_truth,
            "frames_below_coverage": selection.below_coverage,
            **counts,
        },
        "rows": results.summary(),
    }
    with atomic_folder(out) as partial:
        results.write(partial)
        write_json(partial / "evaluation.json", document, "evaluation")
        (partial / "table.md").write_text(markdown(document), encoding="utf-8")
    write_report(
        report,
        stage="benchmark",
        settings=document["settings"],
        inputs={
            "members": release / "metadata" / "members.parquet",
            "frames": release / "metadata" / f"frames-{split}.parquet",
        },
        counts=document["counts"],
        gates=gates,
    )
    return document


def _not_input(release: Release, frame: Loaded, given: Evaluated, settings: Mapping[str, Any]) -> Any:
    sparse = sparse_depth(Frame(release, frame.row))
    return ~input_pixels(given.pixels, given.truth, sparse, settings["input_tolerance_m"])


def _check_plausible(
    release: Release, selection: Selection, method: Method, views: SequenceViews, settings: Mapping[str, Any]
) -> None:
    """CardError where a few frames, spread over the split, show another unit or camera than declared."""
    step = max(1, len(selection.rows) // PROBES)
    probes, ratios = [], []
    for row in selection.rows[::step][:PROBES]:
        view = views.of(row["sequence"])
        frame = load(release, row, selection.files[key(row)], method, view)
        given, _ = evaluated(frame, view, settings)
        if (given.prediction > 0).any():
            ratios.append(1 / median_scale(given.truth, given.prediction))
        probes.append((frame.prediction, frame.points, view.rig))
    check_unit(ratios, method.predictions)
    check_camera(probes, method.space, method.predictions)
