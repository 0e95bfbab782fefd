"""Read a release tree: one frame's modality by its offset, no unpacking."""

import hashlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.artifacts import read_json, read_table
from card.errors import CardError

SPLITS = ("train", "validation", "test", "zero_shot", "unassigned")


class Release:
    """An open release tree.

    >>> release = Release("card-germany")                             # doctest: +SKIP
    >>> points = release.points("de_town_bumps", 12)                  # doctest: +SKIP
    """

    def __init__(self, tree: str | Path) -> None:
        """Read the index of `tree`; CardError if it is no release tree."""
        self.tree = Path(tree)
        columns = read_table(self.tree / "metadata" / "members.parquet", "release_members").to_pydict()
        self._members = {
            (sequence, modality, frame if burst is None else burst): (shard, offset, size, sha256)
            for sequence, modality, frame, burst, shard, offset, size, sha256 in zip(
                *(
                    columns[name]
                    for name in (
                        "sequence",
                        "modality",
                        "frame",
                        "burst",
                        "shard",
                        "offset",
                        "size",
                        "sha256",
                    )
                ),
                strict=True,
            )
        }

    def frames(self, split: str | None = None) -> list[dict[str, Any]]:
        """Rows of the frame table of one split, or of all, by sequence and frame."""
        rows = [
            row
            for name in ([split] if split else SPLITS)
            for row in read_table(
                self.tree / "metadata" / f"frames-{name}.parquet", "release_frames"
            ).to_pylist()
        ]
        return sorted(rows, key=lambda row: (row["sequence"], row["frame"]))

    def read(self, sequence: str, frame: int, modality: str) -> bytes:
        """Bytes of one file; for a LiDAR, `frame` is the burst's number (`<lidar>_burst` of the frame's row).

        CardError if the release has no such file, or if its bytes are not those that were packed.
        """
        try:
            shard, offset, size, sha256 = self._members[sequence, modality, frame]
        except KeyError:
            raise CardError(
                "no such file in the release", where=self.tree, found=f"{sequence}, {frame}, {modality}"
            ) from None
        with (self.tree / shard).open("rb") as file:
            file.seek(offset)
            content = file.read(size)
        if hashlib.sha256(content).hexdigest() != sha256:
            raise CardError(
                "damaged content",
                where=self.tree / shard,
                found=f"{sequence}, {frame}, {modality}",
                wanted=f"sha256 {sha256[:12]}",
            )
        return content

    def image(self, sequence: str, frame: int, camera: str = "camera_left") -> Any:
        """Image as (H, W, 3) uint8 RGB, distorted as it was taken."""
        import numpy as np
        from PIL import Image

        with Image.open(io.BytesIO(self.read(sequence, frame, camera))) as image:
            return np.asarray(image.convert("RGB"))

    def points(self, sequence: str, frame: int) -> Any:
        """Ground truth of a frame: (N, 3) float32 in `camera_left`, m."""
        import numpy as np

        with np.load(io.BytesIO(self.read(sequence, frame, "ground_truth")), allow_pickle=False) as archive:
            return archive["points"]

    def burst(self, sequence: str, burst: int, lidar: str = "lidar_front") -> Any:
        """Raw burst as `laspy.LasData`: x, y, z in the sensor's frame, m; intensity, ring, offset_ns."""
        import laspy

        return laspy.read(io.BytesIO(self.read(sequence, burst, lidar)))

    def boxes(self, sequence: str, frame: int) -> list[tuple[int, float, float, float, float]] | None:
        """Boxes (class, x centre, y centre, width, height), relative to the image; None if not reviewed."""
        if (sequence, "labels", frame) not in self._members:
            return None
        lines = self.read(sequence, frame, "labels").decode().splitlines()
        return [(int(cells[0]), *map(float, cells[1:])) for line in lines if (cells := line.split())]  # type: ignore[misc]

    def calibration(self, sequence: str) -> Mapping[str, Any]:
        """Calibration bundle of a sequence."""
        document: Mapping[str, Any] = read_json(
            self.tree / "sequences" / sequence / "calibration.json", "calibration"
        )
        return document
