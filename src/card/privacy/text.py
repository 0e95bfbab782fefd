"""Plates as what they are, text: a detector of text lines in photographs.

The network gives each pixel the probability to lie in the core of a text line: M. Liao et al., "Real-time
Scene Text Detection with Differentiable Binarization", AAAI 2020. It finds other lettering too; none is worth
a plate.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.detection.onnx import open_session
from card.privacy.detection import Detection
from card.privacy.models import TEXT
from card.privacy.tiling import enlarged_tiles


class TextDetector:
    """Lines of text, taken for plates.

    Parameters
    ----------
    settings : ``enlargement`` (>= 1, of the image before the search), ``probabilities`` (0..1, levels at
        which cores are cut out: what runs together at one is apart at a higher one), ``confidence`` (0..1,
        mean over a core), ``min_width_px`` and ``min_height_px`` of a core, in px of the searched image,
        ``max_height_share`` of the image's longer side, ``aspect`` (least and most of width by height),
        ``min_fill`` (share of its box that a core fills) and ``growth`` (shares of the core's height
        added above and below, and left and right: cores are shrunken, and a plate is wider than its text).
    tile_px, tile_overlap_px : tiles that bound the memory.

    Raises
    ------
    CardError
        If the model is not installed or is another file.
    """

    name = TEXT.name

    def __init__(self, settings: Mapping[str, Any], tile_px: int, tile_overlap_px: int) -> None:
        self._settings, self._tile = settings, (tile_px, tile_overlap_px)
        # Images share the cores already: one thread each.
        self._session = open_session(TEXT.path().read_bytes(), self.name, threads=1)

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Text in ``image``, (H, W, 3) uint8 RGB, tile by tile, each from top to bottom."""
        zoom = self._settings["enlargement"]
        found = []
        max_height_px = self._settings["max_height_share"] * zoom * max(image.shape[:2])
        for view in enlarged_tiles(image, zoom, *self._tile):
            edges, scores = self._boxes(view.pixels, max_height_px)
            for box, score in zip(view.to_image(edges) / zoom - 0.5, scores, strict=True):
                core = Detection.of("plate", box.tolist(), score, self.name, TEXT.sha256)
                width, height = core.size
                across, along = self._settings["growth"]
                found.append(core.grown(along * height / width, across))
        return found

    def _boxes(
        self, pixels: npt.NDArray[np.uint8], max_height_px: float
    ) -> tuple[npt.NDArray[np.float64], list[float]]:
        """Edges (N, 4) px and scores of the cores in one tile."""
        blob = np.ascontiguousarray(pixels[..., ::-1].transpose(2, 0, 1)[None], dtype=np.float32) / 127.5 - 1
        (probability,) = self._session.run(None, {self._session.get_inputs()[0].name: blob})
        parts = [
            _cores(probability[0, 0], level, max_height_px, self._settings)
            for level in self._settings["probabilities"]
        ]
        edges = np.concatenate([part[0] for part in parts])
        return edges, np.concatenate([part[1] for part in parts]).tolist()


def _cores(
    probability: npt.NDArray[np.float32], level: float, max_height_px: float, settings: Mapping[str, Any]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Edges (N, 4) px and mean probabilities (N,) of the connected cores that may be a plate."""
    import cv2

    core = (probability >= level).astype(np.uint8)
    count, label, boxes, _ = cv2.connectedComponentsWithStats(core)
    x, y, width, height, area = np.asarray(boxes, dtype=np.float64).T
    mean = np.bincount(label.ravel(), probability.ravel(), count) / area
    kept = (
        (width >= settings["min_width_px"])
        & (height >= settings["min_height_px"])
        & (height <= max_height_px)
        & (width >= settings["aspect"][0] * height)
        & (width <= settings["aspect"][1] * height)
        & (area >= settings["min_fill"] * width * height)
        & (mean >= settings["confidence"])
    )
    kept[0] = False  # the background
    return np.stack([x, y, x + width, y + height], axis=1)[kept], mean[kept]
