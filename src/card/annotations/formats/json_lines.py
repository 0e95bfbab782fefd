"""JSON whose objects know the line they start on."""

import json
from bisect import bisect_left
from json.decoder import JSONObject  # type: ignore[attr-defined]
from json.scanner import py_make_scanner  # type: ignore[attr-defined]
from pathlib import Path
from typing import Any

from card.annotations.formats.text import read_text
from card.annotations.issues import Issue


class Object(dict[str, Any]):
    """A JSON object and the line of its opening brace, from 1."""

    line = 0


def read_json_lines(path: Path, file: str, issues: list[Issue]) -> Any:
    """The document, its objects as `Object`; None, with an error, for what is not JSON.

    A key that an object has twice is an error, but the document is returned, with the last value.
    """
    text = read_text(path, file, issues)
    if text is None:
        return None
    newlines = [at for at, character in enumerate(text) if character == "\n"]

    def parse_object(text_and_end: tuple[str, int], *arguments: Any) -> tuple[Object, int]:
        start = text_and_end[1] - 1
        pairs, end = JSONObject(text_and_end, *arguments[:2], None, list, *arguments[4:])
        found = Object(pairs)
        found.line = bisect_left(newlines, start) + 1
        if len(found) != len(pairs):
            keys = [key for key, _ in pairs]
            twice = next(key for key in keys if keys.count(key) > 1)
            issues.append(Issue(file, found.line, "repeated_key", f"found {twice} twice in an object"))
        return found, end

    decoder: Any = json.JSONDecoder()
    decoder.parse_object = parse_object
    decoder.scan_once = py_make_scanner(decoder)
    try:
        return decoder.decode(text)
    except json.JSONDecodeError as error:
        issues.append(Issue(file, error.lineno, "syntax", error.msg))
    except RecursionError:
        issues.append(Issue(file, 1, "syntax", "nested too deeply"))
    return None
