"""The frames of reference of one sequence: transforms by name, cameras, the stereo pair."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import CameraModel, Rectification, from_json, inverse, rectify, transform

Array = NDArray[np.float64]


class Rig:
    """What is fixed on the car: `calibration` is the document of that schema."""

    def __init__(self, calibration: Mapping[str, Any]) -> None:
        self._calibration = calibration
        self._rig_from: dict[str, Array] = {"rig": np.eye(4)}
        for name, document in calibration["extrinsics"].items():
            self._rig_from[name.removeprefix("rig_from_")] = from_json(document)
        for wheel, points in calibration["wheels"].items():
            for part in ("center", "contact"):
                self._rig_from[f"wheel_{wheel}_{part}"] = transform(points[f"{part}_m"])

    def transform(self, name: str, moving: Mapping[str, Array]) -> Array:
        """``a_from_b`` (4, 4) by its name; `moving` gives ``rig_from_<frame>`` of frames that the car leaves.

        CardError naming the frames there are for an unknown one.
        """
        known = {**self._rig_from, **moving}
        target, separator, source = name.partition("_from_")
        for frame in (target, source):
            if not separator or frame not in known:
                raise CardError(
                    "unknown transform", found=name, wanted=f"<a>_from_<b> of {', '.join(sorted(known))}"
                )
        return inverse(known[target]) @ known[source]

    def camera(self, name: str) -> CameraModel:
        """Model of ``camera_left`` or ``camera_right``, or of either with ``_undistorted`` behind it.

        The undistorted left pinhole is the calibration's, the right one its own camera without distortion.
        """
        if name == "camera_left_undistorted":
            return CameraModel.from_json(self._calibration[name])
        taken, undistorted = name.removesuffix("_undistorted"), name.endswith("_undistorted")
        if taken not in self._calibration["cameras"]:
            raise CardError("unknown camera", found=name, wanted=" or ".join(self._calibration["cameras"]))
        camera = CameraModel.from_json(self._calibration["cameras"][taken])
        return camera.undistorted() if undistorted else camera

    @cached_property
    def stereo(self) -> Rectification:
        """Rectification of the two cameras."""
        left_from_right = self.transform("camera_left_from_camera_right", {})
        return rectify(self.camera("camera_left"), self.camera("camera_right"), left_from_right)
