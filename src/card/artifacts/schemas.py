"""The schemas under ``schemas/``: JSON Schema for documents, a small vocabulary for tables and arrays."""

import copy
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from card.artifacts import long_arrays
from card.errors import CardError


@cache
def schema_folder() -> Path:
    """Where the schemas are: inside an installed package, or at the root of a checkout."""
    package = Path(__file__).resolve().parents[1]
    for folder in (package / "schemas", package.parents[1] / "schemas"):
        if folder.is_dir():
            return folder
    raise CardError("the schemas are not installed", where=package)


@cache
def load_schema(name: str) -> dict[str, Any]:
    """The schema ``<name>.schema.json``; ``name`` may hold a folder, as in ``settings/wheels``."""
    path = schema_folder() / f"{name}.schema.json"
    if not path.is_file():
        raise CardError("unknown schema", where=path)
    schema: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return schema


@cache
def _validator(name: str) -> Any:
    from jsonschema import Draft202012Validator, validators
    from referencing import Registry, Resource

    def retrieve(uri: str) -> Resource[Any]:
        return Resource.from_contents(load_schema(uri.removesuffix(".schema.json").removeprefix("card:")))

    validator = validators.extend(Draft202012Validator, {"items": long_arrays.items})
    return validator(load_schema(name), registry=Registry(retrieve=retrieve))  # type: ignore[call-arg]


def check(document: Any, schema: str, where: object) -> None:
    """Check a document against a JSON Schema.

    Raises
    ------
    CardError
        Naming the first offending field, what was found and what is wanted.
    """
    errors = sorted(
        _validator(schema).iter_errors(document), key=lambda error: [str(p) for p in error.absolute_path]
    )
    if not errors:
        return
    error = errors[0]
    while error.context:
        error = min(error.context, key=lambda inner: (-len(inner.absolute_path), inner.message))
    field = "/".join(str(part) for part in error.absolute_path) or "document"
    raise CardError(
        f"{field} does not fit schema {schema}",
        where=where,
        found=_shorten(error.message),
        wanted=f"{error.validator} {_shorten(str(error.validator_value))}",
    )


def default_settings(stage: str) -> dict[str, Any]:
    """The settings of a stage as its schema ``settings/<stage>`` gives them."""
    return with_defaults({}, load_schema(f"settings/{stage}"))


def with_defaults(document: Mapping[str, Any], schema: Mapping[str, Any]) -> dict[str, Any]:
    """A document with the defaults of its schema filled in, objects within objects and arrays included."""
    filled = dict(document)
    for name, field in schema.get("properties", {}).items():
        if isinstance(field, bool):  # a schema that permits anything, or nothing
            continue
        if "$ref" in field:
            field = load_schema(field["$ref"].removesuffix(".schema.json").removeprefix("card:"))
        if "properties" in field and isinstance(filled.get(name, {}), Mapping):
            filled[name] = with_defaults(filled.get(name, {}), field)
        elif name not in filled and "default" in field:
            filled[name] = copy.deepcopy(field["default"])
        items = field.get("items", {})
        if isinstance(items, Mapping) and "properties" in items and isinstance(filled.get(name), list):
            filled[name] = [
                with_defaults(item, items) if isinstance(item, Mapping) else item for item in filled[name]
            ]
    return filled


def _shorten(text: str, limit: int = 160) -> str:
    return text if len(text) <= limit else text[: limit - 3] + "..."
