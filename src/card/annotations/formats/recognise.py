"""Which format a label tool has written."""

from pathlib import Path

from card.annotations.formats import FORMATS, cvat
from card.annotations.formats.text import BOM
from card.annotations.formats.xml_lines import root_tag
from card.annotations.formats.yolo import CLASSES, FOLDER
from card.annotations.issues import Issue

AUTO = "auto"


def recognise(annotations: Path, setting: str, issues: list[Issue]) -> str | None:
    """Name of the format in a folder; None where it holds no labels, or with an error.

    setting : a format, or ``auto`` to tell by the files: text under ``labels/`` is YOLO, an XML file's root
    element and the outermost value of a JSON file say the rest. Two formats at once are an error.
    """
    if setting != AUTO:
        return setting
    found: dict[str, str] = {}
    folder = annotations / FOLDER
    if folder.is_dir() and any(path.name != CLASSES for path in folder.iterdir()):
        found["yolo"] = FOLDER
    for path in sorted(annotations.rglob("*")):
        if path.suffix in (".xml", ".json") and folder not in path.parents and path.is_file():
            found.setdefault(_of_file(path), path.relative_to(annotations).as_posix())
    if not found and any(path.name != CLASSES for path in annotations.glob("*.txt")):
        return "yolo"
    if len(found) > 1:
        there = ", ".join(f"{name} in {file}" for name, file in sorted(found.items()))
        wanted = f"one format, or the setting format: {' | '.join(FORMATS)}"
        issues.append(Issue(max(found.values()), 0, "mixed_formats", f"found {there}, wanted {wanted}"))
        return None
    return next(iter(found), None)


def _of_file(path: Path) -> str:
    """What a file is, or the format whose reader says what is wrong with it."""
    if path.suffix == ".xml":
        return "cvat" if root_tag(path) == cvat.ROOT else "voc"
    head = path.read_bytes().removeprefix(BOM).lstrip()
    return "label_studio" if head.startswith(b"[") else "coco"
