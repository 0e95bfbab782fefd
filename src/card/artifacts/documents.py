"""JSON, YAML and sheets, each checked against its schema."""

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from card.artifacts.atomic import atomic_file
from card.artifacts.json_text import json_text
from card.artifacts.schemas import check, load_schema
from card.errors import CardError

_PLAIN = {str, int, float, bool, type(None)}


def write_json(path: Path, document: Any, schema: str) -> None:
    """Write a document that fits ``schema``: UTF-8, sorted keys, no NaN or infinity."""
    plain = _plain(document)
    check(plain, schema, path)
    try:
        text = json_text(plain)
    except ValueError as error:
        strange = next(number for number in _floats(plain) if not math.isfinite(number))
        raise CardError("number is not finite", where=path, found=strange) from error
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8")


def read_json(path: Path, schema: str) -> Any:
    """Read a document and check it against ``schema``; NaN and infinities are refused as when writing."""

    def finite(number: str) -> float:
        if not math.isfinite(value := float(number)):
            raise CardError("number is not finite", where=path, found=number)
        return value

    try:
        document = json.loads(_text(path), parse_float=finite, parse_constant=finite)
    except json.JSONDecodeError as error:
        raise CardError("not JSON", where=f"{path}:{error.lineno}", found=error.msg) from error
    check(document, schema, path)
    return document


def read_yaml(path: Path, schema: str) -> Any:
    """Read a YAML document and check it against ``schema``; dates stay the strings they are written as."""
    import yaml

    class Loader(yaml.SafeLoader):
        # Documents have JSON's types: a date without quotes is a string too.
        yaml_implicit_resolvers = {  # noqa: RUF012
            first: [pair for pair in pairs if pair[0] != "tag:yaml.org,2002:timestamp"]
            for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
        }

    try:
        document = yaml.load(_text(path), Loader=Loader)
    except yaml.YAMLError as error:
        raise CardError("not YAML", where=path, found=error) from error
    check(document, schema, path)
    return document


def read_sheet(path: Path, schema: str) -> list[dict[str, str]]:
    """Read a tab-separated sheet whose header is exactly the schema's properties; each row is checked.

    The cells stay strings; lines that start with ``#`` are comments.
    """
    columns = list(load_schema(schema)["properties"])
    lines = [
        (n, line) for n, line in enumerate(_text(path).splitlines(), 1) if line and not line.startswith("#")
    ]
    if not lines:
        raise CardError("sheet has no header", where=path, wanted="\\t".join(columns))
    rows = list(csv.reader((line for _, line in lines), delimiter="\t"))
    if rows[0] != columns:
        raise CardError("wrong columns", where=path, found=rows[0], wanted=columns)
    sheet = []
    for (number, _), cells in zip(lines[1:], rows[1:], strict=True):
        if len(cells) != len(columns):
            raise CardError(
                "wrong number of cells", where=f"{path}:{number}", found=len(cells), wanted=len(columns)
            )
        row = dict(zip(columns, cells, strict=True))
        check(row, schema, f"{path}:{number}")
        sheet.append(row)
    return sheet


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise CardError("file is missing", where=path) from error
    except UnicodeDecodeError as error:
        raise CardError("not UTF-8", where=path, found=error.reason) from error


def _plain(value: Any) -> Any:
    """Builtins of a value that may hold numpy scalars and arrays."""
    if isinstance(value, list) and _is_plain(value):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(item) for item in value]
    return value


def _is_plain(values: list[Any]) -> bool:
    """Whether a list, or the lists in it, hold builtins alone."""
    lists = set(map(type, values)) == {list}
    return _PLAIN.issuperset(map(type, chain.from_iterable(values) if lists else values))


def _floats(value: Any) -> Iterator[float]:
    """The floats in a document of builtins."""
    if isinstance(value, float):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _floats(item)
