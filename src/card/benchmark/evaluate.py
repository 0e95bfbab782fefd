"""Stage `benchmark`: score a method's depth predictions on one split of a release."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_file, progress, read_json, read_table, write_json, write_report
from card.benchmark.depth_metrics import METRICS
from card.benchmark.frame_scores import REGIONS, SCALINGS, Score, frame_scores
from card.benchmark.predictions import Frame, check_complete, prediction_path, read_prediction
from card.benchmark.table import markdown
from card.errors import CardError
from card.geometry import CameraModel, from_json, rasterize, transform
from card.packaging.reader import SPLITS, Release


def evaluate(
    *,
    release: Path,
    split: str,
    method: str,
    predictions: Path,
    out: Path,
    table: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]] = (),
) -> None:
    """Score the depth maps of one method; full images and label boxes, as predicted and median-scaled.

    Parameters
    ----------
    release : tree of a release; split : one of its splits. method : what its results are called.
    predictions : folder of ``<sequence>/<frame:06d>.npy``: depth (H, W) in metres, floats, original image
        space, 0 or NaN where there is none. One a frame that has ground truth; none of other splits.
    out : document `evaluation`; table : the same as Markdown.

    CardError for a missing or extra prediction, one of the wrong size or type, infinite or negative depth.
    """
    if split not in SPLITS:
        raise CardError("unknown split", found=split, wanted=" or ".join(SPLITS))
    opened = Release(release)
    rows = opened.frames(split)
    evaluated = [row for row in rows if row["has_ground_truth"]]
    check_complete(predictions, map(_key, evaluated), map(_key, rows))

    scores: list[Score] = []
    boxes = without_road = 0
    for row, road, camera in progress(_with_road(opened, evaluated), "evaluate", len(evaluated)):
        frame = _key(row)
        truth = rasterize(opened.points(*frame), camera)
        labels = [box[1:] for box in opened.boxes(*frame) or ()]
        prediction = read_prediction(prediction_path(predictions, frame), camera)
        scores += frame_scores(truth, prediction, camera, road, labels, settings)
        boxes += len(labels)
        without_road += road is None

    about = read_json(release / "release.json", "release")
    once = [score for score in scores if score.scaling == "none"]
    document = {
        "schema": "evaluation",
        "method": method,
        "repository": about["repository"],
        "version": about["version"],
        "split": split,
        "settings": settings,
        "counts": {
            "frames": len(evaluated),
            "frames_without_truth": len(rows) - len(evaluated),
            "frames_without_road": without_road,
            "boxes": boxes,
            "empty_boxes": sum(score.region == "boxes" and score.pixels == 0 for score in once),
            "pixels": sum(score.pixels for score in once if score.region == "full"),
        },
        "rows": [_mean(scores, region, scaling) for region in REGIONS for scaling in SCALINGS],
    }
    write_json(out, document, "evaluation")
    with atomic_file(table) as partial:
        partial.write_text(markdown(document), encoding="utf-8")
    write_report(
        report,
        stage="benchmark",
        settings=settings,
        inputs={
            "members": release / "metadata" / "members.parquet",
            "frames": release / "metadata" / f"frames-{split}.parquet",
        },
        counts=document["counts"],
        gates=gates,
    )


def _key(row: Mapping[str, Any]) -> Frame:
    return row["sequence"], row["frame"]


def _with_road(
    release: Release, rows: Sequence[Mapping[str, Any]]
) -> Iterator[tuple[Mapping[str, Any], NDArray[np.float64] | None, CameraModel]]:
    """Each frame with ``road_from_camera`` (4, 4), None without a valid road plane, and its left camera."""
    sequence = None
    for row in rows:
        if row["sequence"] != sequence:
            sequence = row["sequence"]
            calibration = release.calibration(sequence)
            camera = CameraModel.from_json(calibration["cameras"]["camera_left"])
            rig_from_camera = from_json(calibration["extrinsics"]["rig_from_camera_left"])
            planes = _road_planes(release.tree / "sequences" / sequence / "road_planes.parquet")
        road_from_rig = planes.get(row["frame"])
        yield row, None if road_from_rig is None else road_from_rig @ rig_from_camera, camera


def _road_planes(path: Path) -> dict[int, NDArray[np.float64]]:
    """``road_from_rig`` (4, 4) by frame; empty for a sequence without wheels."""
    if not path.is_file():
        return {}
    return {
        row["frame"]: transform(
            [row[axis] for axis in ("x", "y", "z")], [row[axis] for axis in ("qw", "qx", "qy", "qz")]
        )
        for row in read_table(path, "road_planes").to_pylist()
        if row["valid"]
    }


def _mean(scores: Sequence[Score], region: str, scaling: str) -> dict[str, Any]:
    """Mean over images or boxes but those without pixels and, for heights, without a road."""
    chosen = [score.metrics for score in scores if (score.region, score.scaling) == (region, scaling)]
    names = list(chosen[0]) if chosen else [*METRICS, "height_abs_diff", "height_rmse"]
    means = {}
    for name in names:
        values = np.array([metrics[name] for metrics in chosen])
        known = values[~np.isnan(values)]
        means[name] = float(known.mean()) if known.size else None
    samples = sum(not np.isnan(metrics["abs_rel"]) for metrics in chosen)
    return {"region": region, "scaling": scaling, "samples": samples, "metrics": means}
