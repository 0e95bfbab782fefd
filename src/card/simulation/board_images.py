"""Both cameras of a standing car, photographing the board."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from card.artifacts import atomic_file, check
from card.simulation import board
from card.simulation.ego import ego_pixels
from card.simulation.exposure import DAY, jpeg
from card.simulation.quads import LIGHT, Quad, QuadView
from card.simulation.rig import CAMERAS, STEREO_DELAY_NS, Rig

_EGO_COLOUR = LIGHT[[26, 28, 33]]


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
            light *= np.float32(DAY.white)
            path.write_bytes(jpeg(DAY.taken(light, self._views[name].lens.vignetting, rng)))


def write_board_yaml(folder: Path) -> None:
    """Write board.yaml (schema ``board``) into a session's folder."""
    document: dict[str, Any] = board.description()
    path = folder / "board.yaml"
    check(document, "board", path)
    with atomic_file(path) as partial:
        partial.write_text(yaml.safe_dump(document, sort_keys=True), encoding="utf-8")
