"""Label formats: one module each, a strict reader and a writer that loses nothing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from card.annotations.boxes import Box
from card.annotations.formats import coco, cvat, label_studio, voc, yolo
from card.annotations.formats.collector import Collector
from card.annotations.formats.expected import Expected


@dataclass(frozen=True)
class Format:
    """How labels of one format are read and written.

    read : from the annotations folder into a collector. write : boxes by path of the image into a folder; an
    image without boxes is one that was reviewed.
    """

    read: Callable[[Path, Collector], None]
    write: Callable[[Path, Mapping[str, list[Box]], Expected], None]


FORMATS: Mapping[str, Format] = {
    "yolo": Format(yolo.read, yolo.write),
    "voc": Format(voc.read, voc.write),
    "coco": Format(coco.read, coco.write),
    "cvat": Format(cvat.read, cvat.write),
    "label_studio": Format(label_studio.read, label_studio.write),
}
"""By the name that the setting ``format`` gives them."""
