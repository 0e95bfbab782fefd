"""Arrays that are approved as a whole: what jsonschema says item by item."""

from typing import Any

import pytest
from jsonschema import Draft202012Validator

from card.artifacts.long_arrays import approved

NUMBER = {"type": "number", "minimum": 0, "exclusiveMaximum": 9}
ROWS = {"type": "array", "minItems": 2, "maxItems": 2, "items": NUMBER}
SCHEMAS = [
    NUMBER,
    ROWS,
    {"type": ["number", "null"], "maximum": 5},
    {"type": "integer", "exclusiveMinimum": 0},
    {"type": "boolean"},
    {"type": "string"},
]
VALUES = [
    [], [1, 2.5], [0, 8], [9], [-1], [None], [1, None], [True], [True, False], ["a"], [1.0], [0], [{}],
    [[1, 2]], [[1, 2], [3, 4]], [[1, 2], [3]], [[1, 2], [3, -4]], [[1, "2"]], [[]], [3, [1, 2]],
    [float("nan"), -5],
]  # fmt: skip


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("values", VALUES)
def test_nothing_is_approved_that_does_not_fit(schema: Any, values: list[Any]) -> None:
    fits = Draft202012Validator({"type": "array", "items": schema}).is_valid(values)
    assert fits or not approved(values, schema)


def test_long_arrays_are_approved() -> None:
    assert approved([0, 1.5] * 100, NUMBER)
    assert approved([[0, 1.5]] * 100, ROWS)
    assert approved([None, 4.5] * 100, SCHEMAS[2])
    assert approved([True, False], SCHEMAS[4])


@pytest.mark.parametrize(
    "schema", [True, {}, {"type": "object"}, {"$ref": "#"}, {"type": "number", "multipleOf": 2}]
)
def test_other_schemas_are_not_judged(schema: Any) -> None:
    assert not approved([2], schema)
