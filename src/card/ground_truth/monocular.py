"""A user's monocular depth model in ONNX, run on anonymized images."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.artifacts import read_table, sha256_file
from card.errors import CardError
from card.geometry import CameraModel
from card.ground_truth.consensus import Depth

Floats = npt.NDArray[np.float64]


class OnnxDepth:
    """Depth of the undistorted left image: a `DepthSource`.

    Parameters
    ----------
    images : folder ``anonymized``: no other image may be looked at.
    image, undistorted : cameras of the original and of the undistorted left image.
    settings : ``consensus`` of the stage.

    Raises
    ------
    CardError
        For a model that is missing, has another hash, is no ONNX or has another kind of input.
    """

    def __init__(
        self, images: Path, image: CameraModel, undistorted: CameraModel, settings: Mapping[str, Any]
    ) -> None:
        table = read_table(images / "images.parquet", "images")
        rows = zip(*(table[name].to_pylist() for name in ("camera", "t_ns", "file")), strict=True)
        self._files = {t_ns: images / file for camera, t_ns, file in rows if camera == "camera_left"}
        self._images, self._settings = images, settings
        self._size = undistorted.width, undistorted.height
        grid = np.stack(np.meshgrid(np.arange(undistorted.width), np.arange(undistorted.height)), axis=-1)
        self._map = image.project(undistorted.rays(grid.reshape(-1, 2))).astype(np.float32)
        self._session = _session(Path(settings["model"]), settings["sha256"])
        self._input = self._session.get_inputs()[0]

    def __call__(self, frame: int, t_ns: int) -> Depth:
        """Depth (H, W) up to scale of the frame at `t_ns`; CardError if there is no such image."""
        import cv2

        path = self._files.get(t_ns)
        image = None if path is None else cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            raise CardError("no anonymized image for the consensus", where=self._images, found=t_ns)
        width, height = self._size
        at = self._map.reshape(height, width, 2)
        undistorted = cv2.remap(image, at[..., 0], at[..., 1], cv2.INTER_LINEAR)
        size = self._settings["input_width"], self._settings["input_height"]
        rgb = cv2.resize(cv2.cvtColor(undistorted, cv2.COLOR_BGR2RGB), size, interpolation=cv2.INTER_AREA)
        values = (rgb / 255.0 - self._settings["mean"]) / self._settings["std"]
        batch = values.transpose(2, 0, 1)[None].astype(np.float32)
        found = np.squeeze(self._session.run(None, {self._input.name: batch})[0])
        if found.ndim != 2:
            raise CardError(
                "depth model gives no map",
                where=self._settings["model"],
                found=" x ".join(map(str, found.shape)),
                wanted="one depth a pixel",
            )
        if self._settings["output"] == "inverse_depth":
            found = np.divide(1.0, found, out=np.zeros(found.shape), where=found > 0)
        depth = cv2.resize(found.astype(np.float32), self._size, interpolation=cv2.INTER_LINEAR)
        return np.asarray(depth, dtype=np.float32)


def _session(model: Path, sha256: str) -> Any:
    import onnxruntime

    if not model.is_file():
        raise CardError("depth model is missing", where=model)
    if (found := sha256_file(model)) != sha256:
        raise CardError("depth model is another file", where=model, found=found, wanted=sha256)
    options = onnxruntime.SessionOptions()
    # One thread: sums over threads do not repeat.
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        return onnxruntime.InferenceSession(str(model), options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise CardError("unreadable depth model", where=model, wanted="ONNX") from error
