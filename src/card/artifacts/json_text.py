"""JSON as people read it: a line for each key and each list of plain values, and quick however long."""

import json
from collections.abc import Iterator
from itertools import chain
from typing import Any

# The standard library's indented form takes ten times as long, a line for each number.
_encode = json.JSONEncoder(ensure_ascii=False, allow_nan=False).encode
_NUMBERS = {int, float, bool, type(None)}


def json_text(document: Any) -> str:
    """The text of a document of builtins, with sorted keys.

    Raises ValueError for a number that is not finite.
    """
    return "".join(_pieces(document, "\n")) + "\n"


def _pieces(value: Any, line: str) -> Iterator[str]:
    """The text of a value that stands on lines with this beginning."""
    inner = line + " "
    if isinstance(value, dict) and value:
        lead = "{"
        for key in sorted(value):
            yield f"{lead}{inner}{_encode(key)}: "
            yield from _pieces(value[key], inner)
            lead = ","
        yield line + "}"
    elif isinstance(value, list) and not {dict, list}.isdisjoint(map(type, value)):
        lists = set(map(type, value)) == {list}
        if lists and _NUMBERS.issuperset(map(type, chain.from_iterable(value))):
            # Numbers have no brackets: each pair of them is between two rows.
            rows = _encode(value)[1:-1].replace("], [", f"],{inner}[")
            yield f"[{inner}{rows}{line}]"
            return
        lead = "["
        for item in value:
            yield lead + inner
            yield from _pieces(item, inner)
            lead = ","
        yield line + "]"
    else:
        yield _encode(value)
