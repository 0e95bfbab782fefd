"""What a detector of faces and plates is, and what it returns."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

Kind = Literal["face", "plate"]


@dataclass(frozen=True)
class Detection:
    """One box to redact, in pixels of the original image with pixel centres at integers.

    ``x_min, y_min, x_max, y_max`` are the edges of the box, half a pixel outside its outermost pixel centres;
    they may lie outside the image. ``score`` is the detector's own measure, larger is surer. ``source``
    names the model (a key of ``Detector.models``) that found the box.
    """

    kind: Kind
    x_min: float
    y_min: float
    x_max: float
    y_max: float
    score: float
    source: str

    def grown(self, share: float) -> "Detection":
        """The box with ``share`` of its width and height added on each side."""
        dx = share * (self.x_max - self.x_min)
        dy = share * (self.y_max - self.y_min)
        return replace(
            self, x_min=self.x_min - dx, y_min=self.y_min - dy, x_max=self.x_max + dx, y_max=self.y_max + dy
        )


class Detector(Protocol):
    """Finds faces and plates in one image; the same image always gives the same boxes in the same order."""

    name: str
    version: str
    models: Mapping[str, str]
    """SHA-256 of each model file, by source name."""

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Boxes in ``image``, (H, W, 3) uint8 BGR at native resolution."""
        ...
