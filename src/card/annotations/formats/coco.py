"""COCO: images, categories and annotations in one JSON file, boxes in pixels from the image's outer edges."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from card.annotations.boxes import Box
from card.annotations.formats.collector import Collector
from card.annotations.formats.expected import Expected
from card.annotations.formats.json_fields import Fields
from card.annotations.formats.json_lines import Object, read_json_lines

REVIEWED = "reviewed"
"""Key of an image, true where a person has looked at it."""


def read(annotations: Path, found: Collector) -> None:
    """Every ``.json`` below the folder; an image without boxes is reviewed where `REVIEWED` says so."""
    for path in sorted(annotations.rglob("*.json")):
        file = path.relative_to(annotations).as_posix()
        known = len(found.issues)
        document = read_json_lines(path, file, found.issues)
        if isinstance(document, Object):
            _read_document(document, file, found)
        elif len(found.issues) == known:
            found.issue(file, 1, "unsupported", "found no object, wanted a COCO document")


def _read_document(document: Object, file: str, found: Collector) -> None:
    fields = Fields(found, file)
    names = _categories(document, fields, file, found)
    frames: dict[int, int | None] = {}
    listed: dict[int, Object] = {}
    for image in fields.objects(document, "images"):
        number, name = fields.identity(image, "id"), fields.text(image, "file_name")
        sizes = [fields.number(image, side) for side in ("width", "height")]
        if number is None or name is None:
            continue
        if number in frames:
            found.issue(file, image.line, "repeated_id", f"found image {number} again")
            continue
        frame = found.image(name, file, image.line)
        frames[number] = frame if found.size(sizes[0], sizes[1], file, image.line) else None
        if frames[number] is not None:
            listed[number] = image
    seen: set[int] = set()
    for annotation in fields.objects(document, "annotations"):
        if "id" in annotation and (number := fields.identity(annotation, "id")) is not None:
            if number in seen:
                found.issue(file, annotation.line, "repeated_id", f"found annotation {number} again")
            seen.add(number)
        _read_annotation(annotation, fields, frames, names, file, found)
    for number, image in listed.items():
        frame = frames[number]
        if frame is not None and frame not in found.boxes:
            found.listed(frame, image.get(REVIEWED) is True, file, image.line)
        elif frame is not None:
            found.finish(frame, file)


def _categories(document: Object, fields: Fields, file: str, found: Collector) -> dict[int, str | None]:
    names: dict[int, str | None] = {}
    for category in fields.objects(document, "categories"):
        number, name = fields.identity(category, "id"), fields.text(category, "name")
        if number is None or name is None:
            continue
        if number in names:
            found.issue(file, category.line, "repeated_id", f"found category {number} again")
        elif name in names.values():
            found.issue(file, category.line, "class_map", f"found category {name} again")
        else:
            names[number] = found.class_name(name, file, category.line)
    return names


def _read_annotation(
    annotation: Object,
    fields: Fields,
    frames: Mapping[int, int | None],
    names: Mapping[int, str | None],
    file: str,
    found: Collector,
) -> None:
    image, category = fields.identity(annotation, "image_id"), fields.identity(annotation, "category_id")
    for number, known, what in ((image, frames, "image"), (category, names, "category")):
        if number is not None and number not in known:
            found.issue(file, annotation.line, "dangling_id", f"no {what} has id {number}")
    frame = frames.get(image) if image is not None else None
    if frame is not None:
        found.reviewed(frame)
    if annotation.get("iscrowd"):
        found.issue(file, annotation.line, "not_a_box", "found a crowd region")
        return
    box = fields.numbers(annotation, "bbox", 4)
    name = names.get(category) if category is not None else None
    if frame is not None and name and box:
        found.edges(frame, name, (box[0], box[1], box[0] + box[2], box[1] + box[3]), file, annotation.line)


def write(folder: Path, labels: Mapping[str, list[Box]], expected: Expected) -> None:
    """Write ``annotations.json``, one line an object; ids count from 1."""
    width, height = expected.rules.size
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for number, (image, boxes) in enumerate(labels.items(), 1):
        sizes = {"width": width, "height": height}
        images.append({"id": number, "file_name": image, **sizes, REVIEWED: True})
        for box in boxes:
            x_min, y_min, _, _ = box.edges()
            bbox = [x_min * width, y_min * height, box.width * width, box.height * height]
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": number,
                    "category_id": list(expected.classes).index(box.name) + 1,
                    "bbox": bbox,
                    "area": bbox[2] * bbox[3],
                    "iscrowd": 0,
                }
            )
    categories = [{"id": number, "name": name} for number, name in enumerate(expected.classes, 1)]
    lists = {"images": images, "annotations": annotations, "categories": categories}
    parts = [f'"{key}": [\n' + ",\n".join(map(json.dumps, items)) + "\n]" for key, items in lists.items()]
    (folder / "annotations.json").write_text("{" + ",\n".join(parts) + "}\n", encoding="utf-8")
