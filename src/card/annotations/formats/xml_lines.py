"""XML with the line of every element; no document types, so that no entity can grow or read files."""

from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from card.annotations.issues import Issue


@dataclass
class Element:
    """One element: tag, attributes, text right inside it, children and the line of its start."""

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list["Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["Element"]:
        """Children of a tag."""
        return [child for child in self.children if child.tag == tag]

    def first(self, *path: str) -> "Element | None":
        """First descendant along tags; None where there is none."""
        element: Element | None = self
        for tag in path:
            element = next(iter(element.all(tag)), None) if element else None
        return element


def read_xml(path: Path, file: str, issues: list[Issue]) -> Element | None:
    """Root of an XML file; None, with an error, for one that is not well-formed or has a document type."""
    parser = expat.ParserCreate()
    top = Element("", {}, 0)
    stack = [top]

    def start(tag: str, attributes: dict[str, str]) -> None:
        stack.append(Element(tag, attributes, parser.CurrentLineNumber))

    def end(_: str) -> None:
        element = stack.pop()
        stack[-1].children.append(element)

    def text(data: str) -> None:
        stack[-1].text += data

    def doctype(*_: object) -> None:
        raise _DocumentTypeError

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = text, doctype
    try:
        parser.Parse(path.read_bytes(), True)
    except expat.ExpatError as error:
        issues.append(Issue(file, error.lineno, "syntax", expat.ErrorString(error.code)))
        return None
    except _DocumentTypeError:
        issues.append(Issue(file, parser.CurrentLineNumber, "unsupported", "found a document type"))
        return None
    return top.children[0]


def root_tag(path: Path) -> str | None:
    """Tag of the root element, whatever comes after it; None where nothing does."""
    tags: list[str] = []
    parser = expat.ParserCreate()
    parser.StartElementHandler = lambda tag, _: tags.append(tag)
    with suppress(expat.ExpatError):
        parser.Parse(path.read_bytes(), True)
    return tags[0] if tags else None


class _DocumentTypeError(Exception):
    pass
