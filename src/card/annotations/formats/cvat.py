"""CVAT for images 1.1: one XML file a task, edges in pixels from the image's outer left and upper edges."""

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import quoteattr

from card.annotations.boxes import Box
from card.annotations.formats.collector import Collector, plain
from card.annotations.formats.expected import Expected
from card.annotations.formats.xml_lines import Element, read_xml

ROOT = "annotations"
EDGES = ("xtl", "ytl", "xbr", "ybr")
REVIEWED = "reviewed"
"""Tag that an annotator gives an image without irregularities."""


def read(annotations: Path, found: Collector) -> None:
    """Every ``.xml`` below the folder; an image without boxes is reviewed where it has the tag `REVIEWED`."""
    for path in sorted(annotations.rglob("*.xml")):
        file = path.relative_to(annotations).as_posix()
        root = read_xml(path, file, found.issues)
        if root and root.tag != ROOT:
            found.issue(file, root.line, "unsupported", f"found element {root.tag}, wanted {ROOT}")
        for element in root.children if root and root.tag == ROOT else []:
            if element.tag == "track":
                message = "found a track of a video, wanted the export 'CVAT for images'"
                found.issue(file, element.line, "unsupported", message)
            elif element.tag == "image":
                _read_image(element, file, found)


def _read_image(image: Element, file: str, found: Collector) -> None:
    name = image.attributes.get("name")
    if not name:
        found.issue(file, image.line, "missing_field", "name is missing")
        return
    frame = found.image(name, file, image.line)
    size = [found.number(image.attributes.get(s), s, file, image.line) for s in ("width", "height")]
    if not found.size(size[0], size[1], file, image.line) or frame is None:
        return
    marked = False
    for shape in image.children:
        if shape.tag == "box":
            found.reviewed(frame)
            _read_box(shape, frame, file, found)
        elif shape.tag != "tag":
            found.issue(file, shape.line, "not_a_box", f"found {shape.tag}")
        elif shape.attributes.get("label") == REVIEWED:
            marked = True
        else:
            found.class_name(shape.attributes.get("label", ""), file, shape.line)
    if frame not in found.boxes:
        found.listed(frame, marked, file, image.line)
    found.finish(frame, file)


def _read_box(box: Element, frame: int, file: str, found: Collector) -> None:
    label = found.class_name(box.attributes.get("label", ""), file, box.line)
    rotation = found.number(box.attributes.get("rotation", "0"), "rotation", file, box.line)
    if rotation:
        found.issue(file, box.line, "not_a_box", f"found a rotation of {rotation:g} degrees")
    values = [found.number(box.attributes.get(edge), edge, file, box.line) for edge in EDGES]
    numbers = tuple(value for value in values if value is not None)
    if label and rotation == 0 and len(numbers) == len(EDGES):
        found.edges(frame, label, numbers, file, box.line)


def write(folder: Path, labels: Mapping[str, list[Box]], expected: Expected) -> None:
    """Write ``annotations.xml``; images without boxes get the tag `REVIEWED`."""
    width, height = expected.rules.size
    lines = ['<?xml version="1.0" encoding="utf-8"?>', "<annotations>", "  <version>1.1</version>"]
    for number, (image, boxes) in enumerate(labels.items()):
        lines.append(f'  <image id="{number}" name={quoteattr(image)} width="{width}" height="{height}">')
        lines += [f"    {_box(box, width, height)}" for box in boxes]
        if not boxes:
            lines.append(f'    <tag label="{REVIEWED}" source="manual"></tag>')
        lines.append("  </image>")
    text = "\n".join([*lines, "</annotations>", ""])
    (folder / "annotations.xml").write_text(text, encoding="utf-8")


def _box(box: Box, width: int, height: int) -> str:
    edges = zip(EDGES, box.edges(), (width, height) * 2, strict=True)
    inner = " ".join(f'{name}="{plain(share * size)}"' for name, share, size in edges)
    return f'<box label={quoteattr(box.name)} source="manual" occluded="0" {inner} z_order="0"></box>'
