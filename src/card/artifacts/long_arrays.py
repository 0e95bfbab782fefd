"""Long arrays of plain values, approved as a whole: item by item, jsonschema takes 15 us for each."""

from collections.abc import Iterator, Mapping
from itertools import chain
from types import NoneType
from typing import Any

_PYTHON: dict[str, set[type]] = {
    "number": {int, float},
    "integer": {int},
    "boolean": {bool},
    "null": {NoneType},
    "string": {str},
}
_OF_VALUES = {"type", "description", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"}
_OF_ARRAYS = {"type", "description", "minItems", "maxItems", "items"}


def items(validator: Any, wanted: Any, instance: Any, schema: Mapping[str, Any]) -> Iterator[Any]:
    """The keyword "items" of JSON Schema: errors of the items, if they cannot be approved as a whole."""
    from jsonschema import Draft202012Validator

    if "prefixItems" in schema or not isinstance(instance, list) or not approved(instance, wanted):
        yield from Draft202012Validator.VALIDATORS["items"](validator, wanted, instance, schema)


def approved(values: list[Any], schema: Any) -> bool:
    """Whether all values certainly fit a schema of plain values, or of arrays of them; False if in doubt."""
    if not isinstance(schema, Mapping) or "type" not in schema:
        return False
    if schema["type"] == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems", float("inf"))
        return (
            not schema.keys() - _OF_ARRAYS
            and "items" in schema
            and set(map(type, values)) <= {list}
            and all(low <= length <= high for length in set(map(len, values)))
            and approved(list(chain.from_iterable(values)), schema["items"])
        )
    names = [schema["type"]] if isinstance(schema["type"], str) else schema["type"]
    if schema.keys() - _OF_VALUES or not set(names) <= _PYTHON.keys():
        return False
    if not set(map(type, values)) <= set().union(*(_PYTHON[name] for name in names)):
        return False
    return _within(values, schema)


def _within(values: list[Any], schema: Mapping[str, Any]) -> bool:
    """Whether the numbers among the values keep the bounds of the schema."""
    if not schema.keys() & {"minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"}:
        return True
    numbers = [value for value in values if type(value) in (int, float)]
    if not numbers:
        return True
    low, high = min(numbers), max(numbers)
    return bool(
        low >= schema.get("minimum", low)
        and high <= schema.get("maximum", high)
        and ("exclusiveMinimum" not in schema or low > schema["exclusiveMinimum"])
        and ("exclusiveMaximum" not in schema or high < schema["exclusiveMaximum"])
    )
