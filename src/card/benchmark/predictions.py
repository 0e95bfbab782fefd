"""The folder of a method's predictions: ``<sequence>/<frame:06d>.npy``, checked before it is trusted."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import CameraModel

Frame = tuple[str, int]


def prediction_path(folder: Path, frame: Frame) -> Path:
    """Where the prediction of a frame (sequence, number) lies."""
    return folder / frame[0] / f"{frame[1]:06d}.npy"


def check_complete(folder: Path, wanted: Iterable[Frame], allowed: Iterable[Frame]) -> None:
    """CardError unless the folder holds a file for all ``wanted`` frames and none beside the ``allowed``."""
    if not folder.is_dir():
        raise CardError("no folder of predictions", where=folder)
    missing = [path for frame in wanted if not (path := prediction_path(folder, frame)).is_file()]
    if missing:
        raise CardError(
            "prediction is missing",
            where=missing[0],
            found=f"{len(missing)} missing",
            wanted="one file a frame of the split",
        )
    known = {prediction_path(folder, frame) for frame in allowed}
    extra = sorted(path for path in folder.rglob("*") if path.is_file() and path not in known)
    if extra:
        raise CardError(
            "not a prediction of this split",
            where=extra[0],
            found=f"{len(extra)} extra",
            wanted="<sequence>/<frame:06d>.npy of the split's frames",
        )


def read_prediction(path: Path, camera: CameraModel) -> NDArray[np.float64]:
    """Depth (H, W) in metres, original image space; 0 or NaN where the method gives none.

    CardError for an unreadable file, integers, a wrong size, and infinite or negative depth.
    """
    try:
        depth = np.load(path, allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise CardError("unreadable prediction", where=path, found=error) from error
    if not isinstance(depth, np.ndarray) or depth.dtype.kind != "f":
        found = getattr(depth, "dtype", type(depth).__name__)
        raise CardError("prediction is no array of floats", where=path, found=found, wanted="depth in metres")
    if depth.shape != (camera.height, camera.width):
        raise CardError(
            "wrong size of prediction", where=path, found=depth.shape, wanted=(camera.height, camera.width)
        )
    for name, wrong in (("infinite", np.isinf(depth)), ("negative", depth < 0)):
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise CardError(
                f"{name} depth",
                where=path,
                found=f"{depth[row, column]} at row {row}, column {column}",
                wanted="metres > 0, or 0 or NaN for no prediction",
            )
    return depth.astype(np.float64)
