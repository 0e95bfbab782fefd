"""Both cameras of a standing car, photographing the board."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from card.artifacts import atomic_file, check
from card.simulation import board
from card.simulation.ego import ego_pixels
from card.simulation.quads import Quad, QuadView
from card.simulation.rig import CAMERAS, STEREO_DELAY_NS, Rig

_NOISE = 2.0  # one sigma, of 255
_VIGNETTING = 0.35  # share of light lost in the corners
_JPEG_QUALITY = 95
_EGO_COLOUR = (26, 28, 33)


class BoardCameras:
    """The cameras before one set of surroundings, which are drawn once.

    ego : (height, width) by camera, pixels that show the car itself.
    """

    def __init__(self, rig: Rig, surroundings: Sequence[Quad]) -> None:
        self._views, self._behind = {}, {}
        self.ego: dict[str, NDArray[np.bool_]] = {}
        for name in CAMERAS:
            camera, pose = rig.cameras[name], rig.rig_from[name]
            view = QuadView(camera, pose, samples=2 if camera.width > 1000 else 3)
            self._views[name], self._behind[name] = view, view.draw(surroundings)
            self.ego[name] = ego_pixels(camera, pose)

    def photograph(self, folder: Path, quads: Sequence[Quad], t_ns: int, rng: np.random.Generator) -> None:
        """Write camera_left/<t_ns>.jpg and camera_right/<t_ns + delay>.jpg below `folder`."""
        for name, delay_ns in zip(CAMERAS, (0, STEREO_DELAY_NS), strict=True):
            light = self._views[name].draw(quads, self._behind[name])
            light[self.ego[name]] = _EGO_COLOUR
            path = folder / name / f"{t_ns + delay_ns}.jpg"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(_developed(light, rng))


def write_board_yaml(folder: Path) -> None:
    """Write board.yaml (schema ``board``) into a session's folder."""
    document: dict[str, Any] = board.description()
    path = folder / "board.yaml"
    check(document, "board", path)
    with atomic_file(path) as partial:
        partial.write_text(yaml.safe_dump(document, sort_keys=True), encoding="utf-8")


def _developed(light: NDArray[np.float32], rng: np.random.Generator) -> bytes:
    """JPEG of an image with the lens's vignetting and the sensor's noise."""
    height, width = light.shape[:2]
    y, x = np.ogrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    falloff = (1 - _VIGNETTING * (x * x + y * y) / 2).astype(np.float32)
    noise = rng.standard_normal(light.shape, dtype=np.float32) * _NOISE
    pixels = np.clip(light * falloff[..., None] + noise, 0, 255).astype(np.uint8)
    ok, jpeg = cv2.imencode(
        ".jpg", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    )
    assert ok
    return bytes(jpeg)
