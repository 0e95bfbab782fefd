"""What a detector of faces and plates is, and what it returns."""

from collections.abc import Sequence
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
    names what found the box, and ``model_sha256`` the model behind it; empty for a person.
    """

    kind: Kind
    x_min: float
    y_min: float
    x_max: float
    y_max: float
    score: float
    source: str
    model_sha256: str

    @classmethod
    def of(
        cls, kind: Kind, edges: Sequence[float], score: float, source: str, model_sha256: str
    ) -> "Detection":
        """The box with ``edges`` x_min, y_min, x_max, y_max."""
        x_min, y_min, x_max, y_max = edges
        return cls(kind, x_min, y_min, x_max, y_max, score, source, model_sha256)

    @property
    def edges(self) -> tuple[float, float, float, float]:
        """``x_min, y_min, x_max, y_max``."""
        return self.x_min, self.y_min, self.x_max, self.y_max

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in pixels."""
        return self.x_max - self.x_min, self.y_max - self.y_min

    def grown(self, share_x: float, share_y: float) -> "Detection":
        """The box with these shares of its width and height added on each side."""
        dx, dy = share_x * self.size[0], share_y * self.size[1]
        return replace(
            self, x_min=self.x_min - dx, y_min=self.y_min - dy, x_max=self.x_max + dx, y_max=self.y_max + dy
        )


class Detector(Protocol):
    """Finds faces and plates in one image; the same image always gives the same boxes in the same order."""

    name: str

    def detect(self, image: npt.NDArray[np.uint8]) -> list[Detection]:
        """Boxes in ``image``, (H, W, 3) uint8 RGB at native resolution."""
        ...
