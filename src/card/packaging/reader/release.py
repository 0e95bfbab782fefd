"""A release tree: its tables, and one frame's modality by its offset."""

import hashlib
import io
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json, read_table
from card.errors import CardError
from card.geometry import Roads, inverse, transform
from card.packaging.reader.files import open_files
from card.packaging.reader.frame import Frame
from card.packaging.reader.rig import Rig

SPLITS = ("train", "validation", "test", "zero_shot", "unassigned")
LOCATION = ("sequence", "modality", "frame", "burst", "file", "shard", "offset", "size", "sha256")

Key = tuple[str, str, int]
Array = NDArray[np.float64]


class Release:
    """An open release tree.

    >>> release = Release("card-germany")                             # doctest: +SKIP
    >>> for frame in release.iterate("train"):                        # doctest: +SKIP
    ...     depth, height = frame.depth(), frame.height()
    """

    def __init__(self, tree: str | Path) -> None:
        """Read the index of `tree`: a folder, an address, or ``hf://datasets/<owner>/<name>[@<revision>]``.

        CardError if it is no release tree.
        """
        self._files = open_files(tree)
        self.tree = self._files.root
        self._rigs: dict[str, Rig] = {}
        self._moments: dict[str, dict[tuple[str, int], Array]] = {}
        self._roads: dict[str, Mapping[int, Array]] = {}
        columns = self._table("metadata/members.parquet", "release_members").to_pydict()
        self._members: dict[Key, tuple[Any, ...]] = {
            (sequence, modality, frame if burst is None else burst): tuple(rest)
            for sequence, modality, frame, burst, *rest in zip(
                *(columns[name] for name in LOCATION), strict=True
            )
        }

    @cached_property
    def about(self) -> Mapping[str, Any]:
        """Document `release`: repository, version, licence, counts."""
        document: Mapping[str, Any] = read_json(self._files.local("release.json"), "release")
        return document

    def frames(self, split: str | None = None) -> list[dict[str, Any]]:
        """Rows of the frame table of one split, or of all, by sequence and frame."""
        rows = [
            row
            for name in ([split] if split else SPLITS)
            for row in self._table(f"metadata/frames-{name}.parquet", "release_frames").to_pylist()
        ]
        return sorted(rows, key=lambda row: (row["sequence"], row["frame"]))

    def iterate(self, split: str | None = None, sequence: str | None = None) -> Iterator[Frame]:
        """Frames of one split, or of all, by sequence and frame; nothing is read before it is asked for."""
        for row in self.frames(split):
            if sequence in (None, row["sequence"]):
                yield Frame(self, row)

    def read(self, sequence: str, frame: int, modality: str) -> bytes:
        """Bytes of one file, in one request; for a LiDAR, `frame` is the burst's number.

        CardError if the release has no such file, or if its bytes are not those that were packed.
        """
        _, shard, offset, size, sha256 = self._member(sequence, frame, modality)
        content = self._files.part(shard, offset, size)
        if hashlib.sha256(content).hexdigest() != sha256:
            raise CardError(
                "damaged content",
                where=self.tree / shard,
                found=f"{sequence}, {frame}, {modality}",
                wanted=f"sha256 {sha256[:12]}",
            )
        return content

    def retractions(self) -> list[dict[str, Any]]:
        """Rows of what was taken out of earlier versions."""
        rows: list[dict[str, Any]] = self._table("metadata/retractions.parquet", "retractions").to_pylist()
        return rows

    def names(self) -> list[tuple[Key, str]]:
        """(sequence, modality, frame or burst) and name of all files in the shards, in their order there."""
        return [(key, member[0]) for key, member in self._members.items()]

    def sha256(self, sequence: str, frame: int, modality: str) -> str:
        """Hexadecimal SHA-256 of one file's content."""
        sha256: str = self._member(sequence, frame, modality)[-1]
        return sha256

    def image(self, sequence: str, frame: int, camera: str = "camera_left") -> Any:
        """Image as (H, W, 3) uint8 RGB, distorted as it was taken."""
        from PIL import Image

        with Image.open(io.BytesIO(self.read(sequence, frame, camera))) as image:
            return np.asarray(image.convert("RGB"))

    def redaction_mask(self, sequence: str, frame: int, camera: str = "camera_left") -> Any:
        """Where an image was filled with a constant: (H, W) bool, of the distorted image."""
        model = self.calibration(sequence)["cameras"][camera]
        mask = np.zeros((model["height"], model["width"]), dtype=bool)
        for row in self._table(f"sequences/{sequence}/redactions.parquet", "redactions").to_pylist():
            if (row["frame"], row["camera"]) == (frame, camera):
                mask[row["y_min"] : row["y_max"], row["x_min"] : row["x_max"]] = True
        return mask

    def points(self, sequence: str, frame: int) -> Any:
        """Ground truth of a frame: (N, 3) float32 in `camera_left`, m."""
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
        path = self._files.local(f"sequences/{sequence}/calibration.json")
        document: Mapping[str, Any] = read_json(path, "calibration")
        return document

    def rig(self, sequence: str) -> Rig:
        """Cameras, stereo pair and fixed transforms of a sequence."""
        if sequence not in self._rigs:
            self._rigs[sequence] = Rig(self.calibration(sequence))
        return self._rigs[sequence]

    def transform(
        self, name: str, sequence: str, number: int | None = None, sensor: str = "camera_left"
    ) -> Array:
        """``a_from_b`` (4, 4) by its name, such as ``world_from_camera_left`` or ``rig_from_lidar_rear``.

        `world` needs a moment: the image of frame `number`, or of a LiDAR as `sensor` the end of its burst
        `number`. `road`, the plane under the car, is known for frames. CardError for what is not known.
        """
        moving: dict[str, Array] = {}
        if number is not None:
            pose = self._poses(sequence).get((sensor, number))
            road = self._road(sequence).get(number) if sensor == "camera_left" else None
            moving |= {} if pose is None else {"world": inverse(pose)}
            moving |= {} if road is None else {"road": inverse(road)}
        return self.rig(sequence).transform(name, moving)

    def road(self, sequence: str, frame: int) -> Array | None:
        """``road_from_camera_left`` (4, 4) of a frame; None where its road plane is not known."""
        if frame not in self._road(sequence):
            return None
        return self.transform("road_from_camera_left", sequence, frame)

    def poses(self, sequence: str) -> list[dict[str, Any]]:
        """Rows of the sequence's ``poses.json``, in order of time; empty where it has none."""
        path = self._files.local(f"sequences/{sequence}/poses.json")
        rows: list[dict[str, Any]] = read_json(path, "poses")["poses"] if path.is_file() else []
        return rows

    def _member(self, sequence: str, frame: int, modality: str) -> tuple[Any, ...]:
        try:
            return self._members[sequence, modality, frame]
        except KeyError:
            raise CardError(
                "no such file in the release", where=self.tree, found=f"{sequence}, {frame}, {modality}"
            ) from None

    def _poses(self, sequence: str) -> dict[tuple[str, int], Array]:
        if sequence not in self._moments:
            self._moments[sequence] = {
                (row["sensor"], row["index"]): transform(row["translation_m"], row["rotation_wxyz"])
                for row in self.poses(sequence)
            }
        return self._moments[sequence]

    def _road(self, sequence: str) -> Mapping[int, Array]:
        """``road_from_rig`` by frame."""
        if sequence not in self._roads:
            path = self._files.local(f"sequences/{sequence}/road_planes.parquet")
            self._roads[sequence] = (
                Roads.from_table(read_table(path, "road_planes")).by_frame() if path.is_file() else {}
            )
        return self._roads[sequence]

    def _table(self, path: str, schema: str) -> Any:
        return read_table(self._files.local(path), schema)
