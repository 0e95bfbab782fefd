"""Stage `benchmark`: score a method's trajectories on a split of a release, zero-shot by default."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder, write_json, write_report
from card.benchmark import odometry_metrics as metrics
from card.benchmark.odometry_table import FIGURES, markdown
from card.benchmark.trajectories import find_trajectories, read_trajectory
from card.errors import CardError
from card.geometry import transform
from card.packaging.reader import SPLITS, Release

Array = NDArray[np.float64]


def evaluate_odometry(
    *,
    release: Path,
    split: str,
    method: str,
    predictions: Path,
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """Score trajectories of the left camera; return the document `odometry`.

    Parameters
    ----------
    predictions : folder of ``<sequence>.txt`` for each sequence of the split that has poses, in TUM's form:
        ``t x y z qx qy qz qw`` a line, t in seconds on the sequence's clock, world_from_camera_left in any
        world. A frame may be left out; a pose that is no frame's is an error.
    out : folder with ``odometry.json`` and ``table.md``.

    CardError for missing, extra, unreadable or wrongly timed trajectories.
    """
    if split not in SPLITS:
        raise CardError("unknown split", found=split, wanted=" or ".join(SPLITS))
    opened = Release(release)
    truths: dict[str, tuple[list[int], Array]] = {}
    names = sorted({row["sequence"] for row in opened.frames(split)})
    for name in names:
        if poses := [pose for pose in opened.poses(name) if pose["sensor"] == "camera_left"]:
            from_rig = [transform(pose["translation_m"], pose["rotation_wxyz"]) for pose in poses]
            rig_from_camera = opened.rig(name).transform("rig_from_camera_left", {})
            truths[name] = [pose["t_ns"] for pose in poses], np.array(from_rig) @ rig_from_camera
    find_trajectories(predictions, truths)

    rows, drifts, missed = [], [], 0
    for name, (times, truth) in truths.items():
        used, estimate = read_trajectory(predictions / f"{name}.txt", times)
        missed += len(times) - len(used)
        row, drift = _score(name, truth[used], estimate, settings["segment_lengths_m"])
        rows.append(row)
        drifts.append(drift)
    mean = {figure: _mean([row[figure] for row in rows]) for figure in FIGURES}
    for k, figure in enumerate(("drift_translation_pct", "drift_rotation_deg_per_100m")):
        mean[figure] = _mean(np.concatenate([drift[k] for drift in drifts]) if drifts else [])
    document = {
        "schema": "odometry",
        "method": method,
        "repository": opened.about["repository"],
        "version": opened.about["version"],
        "split": split,
        "settings": {"segment_lengths_m": settings["segment_lengths_m"]},
        "counts": {
            "sequences": len(truths),
            "sequences_without_poses": len(names) - len(truths),
            "frames": sum(row["frames"] for row in rows),
            "frames_not_predicted": missed,
            "segments": sum(row["segments"] for row in rows),
        },
        "sequences": rows,
        "mean": mean,
    }
    with atomic_folder(out) as partial:
        write_json(partial / "odometry.json", document, "odometry")
        (partial / "table.md").write_text(markdown(document), encoding="utf-8")
    inputs = {"frames": release / "metadata" / f"frames-{split}.parquet"}
    settings_used = document["settings"]
    write_report(
        report,
        stage="benchmark",
        settings=settings_used,
        inputs=inputs,
        counts=document["counts"],
        gates=gates,
    )
    return document


def _score(
    name: str, truth: Array, estimate: Array, lengths_m: Sequence[float]
) -> tuple[dict[str, Any], Any]:
    ate, _ = metrics.absolute_error(truth, estimate, with_scale=False)
    scaled, scale = metrics.absolute_error(truth, estimate, with_scale=True)
    each = np.arange(len(truth) - 1)
    translation, rotation = metrics.relative_errors(truth, estimate, each, each + 1)
    first, last, length = metrics.segments(truth, lengths_m)
    moved, turned = metrics.relative_errors(truth, estimate, first, last)
    drift = (100 * moved / length, 100 * np.degrees(turned) / length)
    row = {
        "sequence": name,
        "frames": len(truth),
        "length_m": float(metrics.path_lengths(truth)[-1]),
        "ate_rmse_m": ate,
        "ate_scaled_rmse_m": scaled,
        "scale": scale,
        "rpe_translation_m": float(np.sqrt(np.mean(translation**2))),
        "rpe_rotation_deg": float(np.degrees(np.sqrt(np.mean(rotation**2)))),
        "drift_translation_pct": _mean(drift[0]),
        "drift_rotation_deg_per_100m": _mean(drift[1]),
        "segments": len(length),
    }
    return row, drift


def _mean(values: Any) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
