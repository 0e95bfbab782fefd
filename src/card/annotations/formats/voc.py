"""Pascal VOC: one XML file an image, as labelImg and CVAT write it.

Edges are pixels from the image's outer left and upper edges, as those tools mean them, not the inclusive
pixels from 1 of the original VOC.
"""

from collections.abc import Mapping
from pathlib import Path
from xml.sax.saxutils import escape

from card.annotations.boxes import Box
from card.annotations.formats.collector import Collector, plain
from card.annotations.formats.expected import LEFT, Expected
from card.annotations.formats.xml_lines import Element, read_xml

ROOT = "annotation"
EDGES = ("xmin", "ymin", "xmax", "ymax")


def read(annotations: Path, found: Collector) -> None:
    """Every ``.xml`` below the folder; a file without objects is a frame reviewed without boxes."""
    for path in sorted(annotations.rglob("*.xml")):
        file = path.relative_to(annotations).as_posix()
        root = read_xml(path, file, found.issues)
        if root and root.tag != ROOT:
            found.issue(file, root.line, "unsupported", f"found element {root.tag}, wanted {ROOT}")
        elif root:
            _read_image(root, path.stem, file, found)


def _read_image(root: Element, stem: str, file: str, found: Collector) -> None:
    name, folder = root.first("filename"), root.first("folder")
    if name is None or not name.text.strip():
        found.issue(file, root.line, "missing_field", "filename is missing")
        return
    named = name.text.strip().replace("\\", "/")
    if named.rsplit("/", 1)[-1].rsplit(".", 1)[0] != stem:
        found.issue(file, name.line, "name_mismatch", f"found filename {named}, wanted that of {stem}")
        return
    frame = found.image(f"{folder.text.strip()}/{named}" if folder else named, file, name.line)
    if frame is None or not _size_fits(root, file, found):
        return
    found.reviewed(frame)
    for thing in root.all("object"):
        _read_object(thing, frame, file, found)
    found.finish(frame, file)


def _size_fits(root: Element, file: str, found: Collector) -> bool:
    size = root.first("size")
    if size is None:
        found.issue(file, root.line, "missing_field", "size is missing")
        return False
    children = [size.first(name) for name in ("width", "height")]
    width, height = (
        found.number(child.text if child else None, name, file, child.line if child else size.line)
        for child, name in zip(children, ("width", "height"), strict=True)
    )
    return found.size(width, height, file, size.line)


def _read_object(thing: Element, frame: int, file: str, found: Collector) -> None:
    box, name = thing.first("bndbox"), thing.first("name")
    if box is None:
        shapes = [child.tag for child in thing.children if child.tag in ("polygon", "robndbox")]
        code, message = (
            ("not_a_box", f"found {shapes[0]}") if shapes else ("missing_field", "bndbox is missing")
        )
        found.issue(file, thing.line, code, message)
        return
    label = found.class_name(name.text if name else "", file, name.line if name else thing.line)
    elements = [box.first(edge) for edge in EDGES]
    values = [
        found.number(child.text if child else None, edge, file, child.line if child else box.line)
        for child, edge in zip(elements, EDGES, strict=True)
    ]
    numbers = tuple(value for value in values if value is not None)
    if label and len(numbers) == len(EDGES):
        found.edges(frame, label, numbers, file, box.line)


def write(folder: Path, labels: Mapping[str, list[Box]], expected: Expected) -> None:
    """Write ``<stem>.xml`` for each image."""
    width, height = expected.rules.size
    for image, boxes in labels.items():
        path = Path(image)
        objects = "".join(_object(box, width, height) for box in boxes)
        text = (
            f"<annotation>\n  <folder>{escape(path.parent.name or LEFT)}</folder>\n"
            f"  <filename>{escape(path.name)}</filename>\n"
            f"  <size><width>{width}</width><height>{height}</height><depth>3</depth></size>\n"
            f"{objects}</annotation>\n"
        )
        (folder / f"{path.stem}.xml").write_text(text, encoding="utf-8")


def _object(box: Box, width: int, height: int) -> str:
    edges = zip(EDGES, box.edges(), (width, height) * 2, strict=True)
    inner = "".join(f"<{name}>{plain(share * size)}</{name}>" for name, share, size in edges)
    return f"  <object>\n    <name>{escape(box.name)}</name>\n    <bndbox>{inner}</bndbox>\n  </object>\n"
