"""The embedded detector: the Haar cascades that OpenCV ships."""

from collections.abc import Mapping
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
    face, plate : how each kind is searched for, as ``settings/privacy``: ``cascades`` (names of files in
        OpenCV's data folder, without ``.xml``), ``scale_step`` (> 1, between sizes of the image pyramid),
        ``enlargement`` (>= 1, of the image before the search) and ``growth`` (share of a box's width and
        height added on each side).
    min_neighbors : raw windows that must agree on a box; this count is the score.

    Raises ``CardError`` for a cascade that the installed OpenCV does not have.
    """

    name = "opencv-haar"

    def __init__(self, *, face: Mapping[str, Any], plate: Mapping[str, Any], min_neighbors: int) -> None:
        # Worker processes share the cores already, and one thread keeps the boxes in one order.
        cv2.setNumThreads(1)
        self.version = cv2.__version__
        self._searches: dict[Kind, Mapping[str, Any]] = {"face": face, "plate": plate}
        self._min_neighbors = min_neighbors
        files = {name: cascade_path(name) for name in (*face["cascades"], *plate["cascades"])}
        self._cascades = {name: cv2.CascadeClassifier(str(path)) for name, path in files.items()}
        self.models: Mapping[str, str] = {name: sha256_file(path) for name, path in files.items()}

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Boxes in ``image``, (H, W, 3) uint8 BGR: cascade by cascade, each sorted by place."""
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        found: list[Detection] = []
        for kind, search in self._searches.items():
            zoom = search["enlargement"]
            pixels = (
                cv2.resize(grey, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_CUBIC) if zoom > 1 else grey
            )
            for name in search["cascades"]:
                found += self._search(pixels, kind, name, search)
        return found

    def _search(self, pixels: Any, kind: Kind, name: str, search: Mapping[str, Any]) -> list[Detection]:
        boxes, neighbors = self._cascades[name].detectMultiScale2(
            pixels, scaleFactor=search["scale_step"], minNeighbors=self._min_neighbors
        )
        rows = sorted(
            (*(int(value) for value in box), int(count)) for box, count in zip(boxes, neighbors, strict=True)
        )
        zoom = search["enlargement"]
        return [
            Detection(
                kind,
                x / zoom - 0.5,
                y / zoom - 0.5,
                (x + width) / zoom - 0.5,
                (y + height) / zoom - 0.5,
                score=float(count),
                source=name,
            ).grown(search["growth"])
            for x, y, width, height, count in rows
        ]


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
