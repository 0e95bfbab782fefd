"""What labels must fit: the frames, the image and the classes of a sequence."""

from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from pathlib import PurePosixPath

from card.annotations.boxes import Rules

LEFT, RIGHT = "camera_left", "camera_right"


@dataclass(frozen=True)
class Expected:
    """What a sequence has.

    frames : number of the frame by the stem of its left image. right : stems of the right images.
    classes : names in the order of their ids. rules : image size and limits of the checks.
    listed_is_reviewed : whether an image that is listed without boxes, and without a mark, was reviewed.
    """

    frames: Mapping[str, int]
    right: AbstractSet[str]
    classes: Sequence[str]
    rules: Rules
    listed_is_reviewed: bool = False

    def frame_of(self, image: str) -> int | None:
        """Frame of the left image at a path of any system; None where it is no such image."""
        return None if self.is_right(image) else self.frames.get(_path(image).stem)

    def is_right(self, image: str) -> bool:
        """Whether a path leads to an image of the right camera, by its folder or by its time."""
        path = _path(image)
        folders = path.parts[:-1]
        return RIGHT in folders or (
            LEFT not in folders and path.stem not in self.frames and path.stem in self.right
        )


def _path(image: str) -> PurePosixPath:
    return PurePosixPath(image.replace("\\", "/"))
