"""Label Studio's JSON: a list of tasks, rectangles in percent of the image."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

from card.annotations.boxes import Box
from card.annotations.formats.collector import Collector
from card.annotations.formats.expected import Expected
from card.annotations.formats.json_fields import Fields
from card.annotations.formats.json_lines import Object, read_json_lines

PERCENT = 100.0
IMAGE = "image"
RECTANGLE = "rectanglelabels"
# Put before the name of an uploaded file.
_UPLOAD = re.compile(r"(?:.*/)?[0-9a-f]{8}-([^/]+)")


def read(annotations: Path, found: Collector) -> None:
    """Every ``.json`` below the folder.

    A task without a finished annotation was not reviewed; one with an empty annotation was, without boxes.
    Predictions are never read.
    """
    for path in sorted(annotations.rglob("*.json")):
        file = path.relative_to(annotations).as_posix()
        known = len(found.issues)
        tasks = read_json_lines(path, file, found.issues)
        if isinstance(tasks, list):
            for task in Fields(found, file).objects(Object(tasks=tasks), "tasks"):
                _read_task(task, file, found)
        elif len(found.issues) == known:
            found.issue(file, 1, "unsupported", "found no list, wanted the tasks of a Label Studio export")


def _read_task(task: Object, file: str, found: Collector) -> None:
    fields = Fields(found, file)
    data = fields.object(task, "data")
    address = fields.text(data, IMAGE) if data is not None else None
    if address is None:
        return
    frame = found.image(_file_name(address), file, task.line)
    finished = [one for one in fields.objects(task, "annotations") if not one.get("was_cancelled")]
    if len(finished) > 1:
        message = f"found {len(finished)} annotations of one image, wanted one that is agreed on"
        found.issue(file, task.line, "repeated_image", message)
    elif finished and frame is not None:
        found.reviewed(frame)
        for result in fields.objects(finished[0], "result"):
            _read_result(result, frame, fields, file, found)
        found.finish(frame, file)


def _file_name(address: str) -> str:
    """The path in a task's address: local file, upload, or any URL."""
    parts = urlsplit(address)
    local = parse_qs(parts.query).get("d")
    path = local[0] if local else unquote(parts.path)
    upload = _UPLOAD.fullmatch(path) if "/upload/" in path else None
    return upload[1] if upload else path


def _read_result(result: Object, frame: int, fields: Fields, file: str, found: Collector) -> None:
    kind = fields.text(result, "type")
    if kind is not None and kind != RECTANGLE:
        found.issue(file, result.line, "not_a_box", f"found {kind}, wanted {RECTANGLE}")
    value = fields.object(result, "value") if kind == RECTANGLE else None
    if value is None:
        return
    sizes = [fields.number(result, f"original_{side}") for side in ("width", "height")]
    names = value.get(RECTANGLE)
    if not isinstance(names, list) or len(names) != 1 or not isinstance(names[0], str):
        found.issue(file, value.line, "unknown_class", f"found {names}, wanted one class")
        return
    name = found.class_name(names[0], file, value.line)
    if value.get("rotation"):
        found.issue(file, value.line, "not_a_box", f"found a rotation of {value['rotation']} degrees")
        return
    numbers = [fields.number(value, key) for key in ("x", "y", "width", "height")]
    shares = [number / PERCENT for number in numbers if number is not None]
    if found.size(sizes[0], sizes[1], file, result.line) and name and len(shares) == len(numbers):
        x, y, width, height = shares
        found.add(frame, Box(name, x + width / 2, y + height / 2, width, height, value.line), file)


def write(
    folder: Path,
    labels: Mapping[str, list[Box]],
    expected: Expected,
    proposals: Mapping[str, list[Box]] | None = None,
) -> None:
    """Write ``annotations.json``, one line a task; images are served as local files.

    proposals : boxes of other images; they become predictions, which are no review.
    """
    tasks: list[dict[str, object]] = []
    for image, boxes in {**labels, **(proposals or {})}.items():
        found = {"result": _results(boxes, expected)}
        task: dict[str, object] = {"id": len(tasks) + 1, "data": {IMAGE: f"/data/local-files/?d={image}"}}
        if image in labels:
            task["annotations"] = [{**found, "was_cancelled": False}]
        else:
            task |= {"annotations": [], "predictions": [found]}
        tasks.append(task)
    text = "[\n" + ",\n".join(json.dumps(task) for task in tasks) + "\n]\n"
    (folder / "annotations.json").write_text(text, encoding="utf-8")


def _results(boxes: list[Box], expected: Expected) -> list[dict[str, object]]:
    """Rectangles of one image as Label Studio keeps them, in annotations and in predictions."""
    width, height = expected.rules.size
    return [
        {
            "id": f"box{number}",
            "type": RECTANGLE,
            "from_name": "label",
            "to_name": IMAGE,
            "original_width": width,
            "original_height": height,
            "value": {
                "x": PERCENT * box.edges()[0],
                "y": PERCENT * box.edges()[1],
                "width": PERCENT * box.width,
                "height": PERCENT * box.height,
                "rotation": 0,
                RECTANGLE: [box.name],
            },
        }
        for number, box in enumerate(boxes, 1)
    ]
