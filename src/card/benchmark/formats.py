"""Files of depth maps: npy, npz, 16-bit PNG, OpenEXR."""

import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from card.errors import CardError

#: KITTI's convention: depth in metres times 256.
PNG_UNIT_M = 1 / 256


def read_depth(path: Path, unit_m: float | None = None) -> Any:
    """Depth (H, W) in metres, float; 0 or NaN where there is none.

    unit_m : metres that 1 in the file stands for; None is 1, and 1/256 in a PNG, as KITTI has it.

    CardError for a file that cannot be read or holds no array of numbers with two axes.
    """
    try:
        values = READERS[path.suffix](path)
    except CardError:
        raise
    except (OSError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise CardError("unreadable prediction", where=path, found=error) from error
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fui" or values.ndim != 2:
        found = f"{getattr(values, 'dtype', type(values).__name__)} {getattr(values, 'shape', '')}"
        raise CardError("prediction is no depth map", where=path, found=found, wanted="numbers (H, W)")
    unit = unit_m if unit_m is not None else PNG_UNIT_M if path.suffix == ".png" else 1.0
    if unit == 1 and values.dtype.kind == "f":
        return values
    return values * np.float64(unit)


def _npy(path: Path) -> Any:
    return np.load(path, allow_pickle=False)


def _npz(path: Path) -> Any:
    with np.load(path, allow_pickle=False) as archive:
        names = archive.files
        name = "depth" if "depth" in names else names[0] if len(names) == 1 else None
        if name is None:
            raise CardError("which array is the depth?", where=path, found=names, wanted="depth")
        return archive[name]


def _png(path: Path) -> Any:
    try:
        from PIL import Image
    except ImportError as error:
        raise CardError("PNG predictions need pillow", where=path, wanted="pip install pillow") from error
    with Image.open(path) as image:
        if image.format != "PNG" or not image.mode.startswith("I"):
            raise CardError(
                "prediction is no 16-bit PNG",
                where=path,
                found=f"{image.format} {image.mode}",
                wanted="one channel",
            )
        return np.asarray(image)


def _exr(path: Path) -> Any:
    try:
        import OpenEXR
    except ImportError as error:
        raise CardError(
            "EXR predictions need OpenEXR", where=path, wanted="pip install card-release[exr]"
        ) from error
    with OpenEXR.File(str(path)) as image:
        channels = {name: channel.pixels for name, channel in image.channels().items()}
    name = next((name for name in ("Z", "depth", "Y") if name in channels), None)
    if name is None and len(channels) == 1:
        name = next(iter(channels))
    if name is None:
        raise CardError("which channel is the depth?", where=path, found=sorted(channels), wanted="Z")
    return np.asarray(channels[name])


READERS: dict[str, Callable[[Path], Any]] = {".npy": _npy, ".npz": _npz, ".png": _png, ".exr": _exr}
