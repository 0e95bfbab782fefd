"""Anonymized left images: the only ones that leave the house, and the only ones a detector sees here."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from card.artifacts import read_table, sha256_file
from card.errors import CardError

LEFT = "camera_left"


@dataclass(frozen=True)
class LeftImage:
    """One anonymized image: file, hash, size in px."""

    path: Path
    sha256: str
    width: int
    height: int

    def verified(self) -> Path:
        """The file; CardError unless it is just what the privacy stage wrote."""
        if not self.path.is_file():
            raise CardError("anonymized image is missing", where=self.path)
        if (found := sha256_file(self.path)) != self.sha256:
            raise CardError(
                "image is not the anonymized one", where=self.path, found=found, wanted=self.sha256
            )
        return self.path


def left_images(images: Path, frames: Path) -> Mapping[int, LeftImage]:
    """By frame the images of table ``images``, which lies in the folder of the anonymized images."""
    table = read_table(frames, "frames")
    number = dict(zip(table["t_ns"].to_pylist(), table["frame"].to_pylist(), strict=True))
    return {
        number[row["t_ns"]]: LeftImage(
            images.parent / row["file"], row["sha256"], row["width"], row["height"]
        )
        for row in read_table(images, "images").to_pylist()
        if row["camera"] == LEFT
    }
