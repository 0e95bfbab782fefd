"""Faces by CenterFace, a network that marks the centre of each face.

Y. Xu et al., "CenterFace: Joint Face Detection and Alignment Using Face as Point", Scientific Programming,
2020.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from card.detection.boxes import keep_best
from card.detection.onnx import open_session
from card.privacy.detection import Detection
from card.privacy.models import CENTERFACE
from card.privacy.tiling import enlarged_tiles

# Names of the network's input and outputs: heat map, log size, offset, landmarks (unused).
_INPUT, _OUTPUTS = "input.1", ("537", "538", "539")
_STRIDE = 4
_NMS_IOU = 0.5


class CenterFaceDetector:
    """Faces in all poses.

    Parameters
    ----------
    settings : ``enlargement`` (>= 1, of the image before the search), ``confidence`` (0..1), ``growth``
        (shares of width and height added on each side, since the network marks brows to chin).
    tile_px, tile_overlap_px : tiles that bound the memory.

    Raises
    ------
    CardError
        If the model is not installed or is another file.
    """

    name = CENTERFACE.name

    def __init__(self, settings: Mapping[str, Any], tile_px: int, tile_overlap_px: int) -> None:
        self._settings, self._tile = settings, (tile_px, tile_overlap_px)
        # Images share the cores already: one thread each.
        self._session = open_session(_any_size(CENTERFACE.path().read_bytes()), self.name, threads=1)

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Faces in ``image``, (H, W, 3) uint8 RGB, the surest first."""
        zoom = self._settings["enlargement"]
        parts = [(np.empty((0, 4)), np.empty(0))]
        for view in enlarged_tiles(image, zoom, *self._tile):
            edges, scores = self._boxes(view.pixels)
            parts.append((view.to_image(edges) / zoom, scores))
        edges, scores = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        kept = keep_best(edges, scores, np.zeros(len(edges), dtype=np.int64), _NMS_IOU)
        growth = self._settings["growth"]
        return [
            # Here pixel centres are at integers, so the image's outer edge is at -0.5.
            Detection.of("face", (edges[i] - 0.5).tolist(), scores[i], self.name, CENTERFACE.sha256).grown(
                growth, growth
            )
            for i in kept.tolist()
        ]

    def _boxes(
        self, pixels: npt.NDArray[np.uint8]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Edges (N, 4) px and scores (N,) in one tile."""
        blob = np.ascontiguousarray(pixels.transpose(2, 0, 1)[None], dtype=np.float32)
        heat, size, offset = self._session.run(list(_OUTPUTS), {_INPUT: blob})
        row, column = np.nonzero(heat[0, 0] >= self._settings["confidence"])
        height, width = np.exp(size[0, :, row, column].T.astype(np.float64)) * _STRIDE
        shift_y, shift_x = offset[0, :, row, column].T
        x, y = (column + shift_x + 0.5) * _STRIDE, (row + shift_y + 0.5) * _STRIDE
        edges = np.stack([x - width / 2, y - height / 2, x + width / 2, y + height / 2], axis=1)
        return edges.astype(np.float64), heat[0, 0, row, column].astype(np.float64)


def _any_size(content: bytes) -> bytes:
    """The model with free batch, height and width: it was exported for one small size."""
    import onnx

    model = onnx.load_model_from_string(content)
    weights = {weight.name for weight in model.graph.initializer}
    inputs = [value for value in model.graph.input if value.name not in weights]
    # Weights that are inputs as well cannot be folded.
    del model.graph.input[:]
    model.graph.input.extend(inputs)
    for value in (*model.graph.input, *model.graph.output):
        dimensions = value.type.tensor_type.shape.dim
        for place, name in ((0, "batch"), (2, f"height of {value.name}"), (3, f"width of {value.name}")):
            dimensions[place].dim_param = name
    return bytes(model.SerializeToString())
