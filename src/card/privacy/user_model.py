"""A user's own detector of faces and plates."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from card.detection import OnnxDetector
from card.privacy.detection import Detection


class UserModel:
    """An ONNX model of the YOLOv8 family.

    Parameters
    ----------
    settings : an entry of ``models`` in ``settings/privacy``.

    Raises
    ------
    CardError
        For a missing file, another hash, no ONNX, or an input or output of another shape.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._settings = settings
        self._detector = OnnxDetector(
            Path(settings["path"]), sha256=settings["sha256"], classes=settings["classes"], settings=settings
        )
        self.name = self._detector.name

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Boxes in ``image``, (H, W, 3) uint8 RGB, the surest first."""
        growth = self._settings["growth"]
        return [
            Detection(
                "face" if box.name == "face" else "plate",
                box.x_min - 0.5,
                box.y_min - 0.5,
                box.x_max - 0.5,
                box.y_max - 0.5,
                box.confidence,
                self.name,
                self._settings["sha256"],
            ).grown(growth, growth)
            for box in self._detector.detect(image)
        ]
