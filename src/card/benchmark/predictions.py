"""The folder of a method's predictions: ``<sequence>/<frame:06d>.<format>``, checked before it is trusted."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from card.benchmark.formats import READERS, read_depth
from card.benchmark.image_space import ImageSpace
from card.errors import CardError

Frame = tuple[str, int]


def find_predictions(folder: Path, wanted: Iterable[Frame], allowed: Iterable[Frame]) -> dict[Frame, Path]:
    """The file of each wanted frame (sequence, number).

    CardError unless the folder holds just one for each wanted frame and none beside those of allowed frames.
    """
    if not folder.is_dir():
        raise CardError("no folder of predictions", where=folder)
    there: dict[Path, list[Path]] = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        there.setdefault(path.with_suffix("") if path.suffix in READERS else path, []).append(path)
    found = {frame: there.get(_stem(folder, frame), []) for frame in wanted}
    missing = [frame for frame, paths in found.items() if not paths]
    formats = ",".join(suffix[1:] for suffix in READERS)
    if missing:
        raise CardError(
            "prediction is missing",
            where=_stem(folder, missing[0]),
            found=f"{len(missing)} missing",
            wanted=f"one file a frame of the split, {formats}",
        )
    twice = [paths for paths in found.values() if len(paths) > 1]
    if twice:
        raise CardError("prediction is there twice", where=twice[0][0], found=twice[0][1].name)
    known = {_stem(folder, frame) for frame in allowed}
    extra = [paths[0] for stem, paths in there.items() if stem not in known]
    if extra:
        raise CardError(
            "not a prediction of this split",
            where=extra[0],
            found=f"{len(extra)} extra",
            wanted=f"<sequence>/<frame:06d> of the split's frames, {formats}",
        )
    return {frame: paths[0] for frame, paths in found.items()}


def read_prediction(
    path: Path, space: ImageSpace, others: Iterable[ImageSpace] = (), unit_m: float | None = None
) -> Any:
    """Depth (H, W) in metres of the image of a space; 0 or NaN where the method gives none.

    others : spaces of the other camera, so that a size that is theirs is told as such.

    CardError for an unreadable file, a wrong size, and infinite or negative depth.
    """
    depth = read_depth(path, unit_m)
    camera = space.camera
    if depth.shape != (camera.height, camera.width):
        theirs = any(depth.shape == (other.camera.height, other.camera.width) for other in others)
        raise CardError(
            "prediction of the wrong camera" if theirs else "wrong size of prediction",
            where=path,
            found=f"{depth.shape}{', that of camera_right' if theirs else ''}",
            wanted=f"{(camera.height, camera.width)}, the {space.name} image of camera_left",
        )
    # One pass finds what is rare; what is wrong is looked for only then.
    lowest, highest = np.fmin.reduce(depth, axis=None), np.fmax.reduce(depth, axis=None)
    for name, wrong in (
        ("infinite", lambda: np.isinf(depth)) if np.isinf(highest) or np.isinf(lowest) else ("", None),
        ("negative", lambda: depth < 0) if lowest < 0 else ("", None),
    ):
        if wrong is not None:
            row, column = np.argwhere(wrong())[0]
            raise CardError(
                f"{name} depth",
                where=path,
                found=f"{depth[row, column]} at row {row}, column {column}",
                wanted="metres > 0, or 0 or NaN for no prediction",
            )
    return depth


def _stem(folder: Path, frame: Frame) -> Path:
    return folder / frame[0] / f"{frame[1]:06d}"
