"""One frame of a release: images, points, maps and transforms, each read when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import pixel_map, rasterize, remap

if TYPE_CHECKING:
    from card.packaging.reader.release import Release

Array = NDArray[np.float64]


class Frame:
    """A frame of an open release; `row` is its row of the frame table."""

    def __init__(self, release: Release, row: Mapping[str, Any]) -> None:
        self._release = release
        self.row = row
        self.sequence: str = row["sequence"]
        self.number: int = row["frame"]

    @property
    def release(self) -> Release:
        """The release that the frame is of."""
        return self._release

    def image(self, camera: str = "camera_left") -> Any:
        """Image (H, W, 3) uint8 RGB as taken; with ``_undistorted`` behind the camera's name, undistorted."""
        taken = camera.removesuffix("_undistorted")
        image = self._release.image(self.sequence, self.number, taken)
        if camera == taken:
            return image
        rig = self._release.rig(self.sequence)
        return remap(image, pixel_map(rig.camera(camera), rig.camera(taken)))

    def rectified(self) -> tuple[Any, Any]:
        """Left and right image with corresponding rows; `Release.rig(sequence).stereo` says how."""
        stereo = self._release.rig(self.sequence).stereo
        return (
            remap(self.image("camera_left"), stereo.left_map),
            remap(self.image("camera_right"), stereo.right_map),
        )

    def points(self) -> Any:
        """Ground truth (N, 3) float32 in `camera_left`, m."""
        return self._release.points(self.sequence, self.number)

    def depth(self, camera: str = "camera_left") -> Array:
        """Depth (H, W) of the ground truth in `camera_left` or `camera_left_undistorted`, m; NaN for none.

        The nearest z of each rounded pixel.
        """
        if not camera.startswith("camera_left"):
            raise CardError("ground truth is of the left camera", found=camera, wanted="camera_left")
        return rasterize(self.points(), self._release.rig(self.sequence).camera(camera))

    def height(self, camera: str = "camera_left") -> Array:
        """Height (H, W) of the same points over the frame's road plane, m; NaN for none.

        CardError where the plane of the frame is not known.
        """
        depth = self.depth(camera)
        model = self._release.rig(self.sequence).camera(camera)
        road_from_camera = self.transform("road_from_camera_left")
        rows, columns = np.nonzero(~np.isnan(depth))
        rays = model.rays(np.stack([columns, rows], axis=-1))
        depth[rows, columns] = (
            depth[rows, columns] * (rays @ road_from_camera[2, :3]) + road_from_camera[2, 3]
        )
        return depth

    def burst(self, lidar: str = "lidar_front") -> Any:
        """The burst that belongs to the frame, as `laspy.LasData`; None where there is none."""
        if not self.row[f"has_{lidar}"]:
            return None
        return self._release.burst(self.sequence, self.row[f"{lidar}_burst"], lidar)

    def boxes(self) -> list[tuple[int, float, float, float, float]] | None:
        """Boxes (class, x centre, y centre, width, height), relative to the image; None if not reviewed."""
        return self._release.boxes(self.sequence, self.number)

    def transform(self, name: str) -> Array:
        """``a_from_b`` (4, 4) by its name at the time of the image."""
        return self._release.transform(name, self.sequence, self.number)
