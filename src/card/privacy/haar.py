"""The embedded detector: the Haar cascades that OpenCV ships."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from card.artifacts import sha256_file
from card.errors import CardError
from card.privacy.detection import Detection, Kind


class HaarDetector:
    """Frontal faces and plates by boosted Haar cascades (Viola and Jones, CVPR 2001), loosely set.

    Parameters
    ----------
    face_cascades, plate_cascades : names of cascade files in OpenCV's data folder, without ``.xml``.
    scale_step : factor (> 1) between neighbouring sizes of the image pyramid.
    min_neighbors : raw windows that must agree on a box; this count is the score.
    face_growth, plate_growth : share of a box's width and height added on each side. A face cascade marks
        brows to chin, a plate cascade the characters.

    Raises ``CardError`` for a cascade that the installed OpenCV does not have.
    """

    name = "opencv-haar"

    def __init__(
        self,
        *,
        face_cascades: Sequence[str],
        plate_cascades: Sequence[str],
        scale_step: float,
        min_neighbors: int,
        face_growth: float,
        plate_growth: float,
    ) -> None:
        # Worker processes share the cores already, and one thread keeps the boxes in one order.
        cv2.setNumThreads(1)
        self.version = cv2.__version__
        self._scale_step = scale_step
        self._min_neighbors = min_neighbors
        self._growth: dict[Kind, float] = {"face": face_growth, "plate": plate_growth}
        self._cascades: list[tuple[Kind, str, Any]] = []
        models: dict[str, str] = {}
        kinds: tuple[tuple[Kind, Sequence[str]], ...] = (("face", face_cascades), ("plate", plate_cascades))
        for kind, names in kinds:
            for name in names:
                path = cascade_path(name)
                self._cascades.append((kind, name, cv2.CascadeClassifier(str(path))))
                models[name] = sha256_file(path)
        self.models: Mapping[str, str] = models

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Boxes in ``image``, (H, W, 3) uint8 BGR: cascade by cascade, each sorted by place."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        found: list[Detection] = []
        for kind, name, cascade in self._cascades:
            boxes, neighbors = cascade.detectMultiScale2(
                grey, scaleFactor=self._scale_step, minNeighbors=self._min_neighbors
            )
            rows = sorted(
                (*(int(value) for value in box), int(count))
                for box, count in zip(boxes, neighbors, strict=True)
            )
            found += [
                Detection(
                    kind, x - 0.5, y - 0.5, x + width - 0.5, y + height - 0.5, score=float(count), source=name
                ).grown(self._growth[kind])
                for x, y, width, height, count in rows
            ]
        return found


def cascade_path(name: str) -> Path:
    """The file of a cascade in the installed OpenCV; ``CardError`` when it is not there."""
    # OpenCV 5 has neither the module nor the files.
    data = getattr(cv2, "data", None)
    path = Path(data.haarcascades if data else "") / f"{name}.xml"
    if not path.is_file() or not hasattr(cv2, "CascadeClassifier"):
        raise CardError(
            "no such cascade in the installed OpenCV",
            where=name,
            found=f"opencv {cv2.__version__}",
            wanted="opencv-python-headless >= 4.14, < 5",
        )
    return path
