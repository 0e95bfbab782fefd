"""Label formats: one module each, a strict reader and a writer that loses nothing."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from card.annotations.boxes import Box
from card.annotations.formats import coco, cvat, label_studio, voc, yolo
from card.annotations.formats.collector import Collector
from card.annotations.formats.expected import Expected

Labels = Mapping[str, list[Box]]


@dataclass(frozen=True)
class Format:
    """How labels of one format are read and written.

    read : from the annotations folder into a collector. write : boxes by path of the image into a folder; an
    image without boxes is one that was reviewed.
    """

    read: Callable[[Path, Collector], None]
    write: Callable[[Path, Labels, Expected], None]

    def offer(self, folder: Path, labels: Labels, proposals: Labels, expected: Expected) -> None:
        """Write labels of reviewed images, and proposals for others.

        Only Label Studio keeps the two apart; in the other formats a proposal looks like a label, so such a
        folder must not come back before a person has seen all of it.
        """
        if self.write is label_studio.write:
            label_studio.write(folder, labels, expected, proposals)
        else:
            self.write(folder, {**labels, **proposals}, expected)


FORMATS: Mapping[str, Format] = {
    "yolo": Format(yolo.read, yolo.write),
    "voc": Format(voc.read, voc.write),
    "coco": Format(coco.read, coco.write),
    "cvat": Format(cvat.read, cvat.write),
    "label_studio": Format(label_studio.read, label_studio.write),
}
"""By the name that the setting ``format`` gives them."""
