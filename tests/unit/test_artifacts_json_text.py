"""The text of JSON documents: what the standard library says of them, in lines that people read."""

import json
from typing import Any

import pytest

from card.artifacts.json_text import json_text

ROWS = [[1_776_153_600_000_000_123, 0.1 + 0.2, -1e-9], [], [None, True, 1e300]]
DOCUMENTS = [
    {"b": {"y": ROWS, "x": []}, "a": {}},
    [ROWS, ROWS],
    [[["deep"], {}], [], {"a": [{}]}],
    [["], [", 'quote "], [" ä'], ["\n"]],
    [1, [2, [3]], "], ["],
    "text",
    0.25,
    None,
]


@pytest.mark.parametrize("document", DOCUMENTS)
def test_nothing_is_lost(document: Any) -> None:
    assert json.loads(json_text(document)) == document
    assert json.loads(json_text([document])) == [document]


def test_keys_are_sorted_and_plain_lists_are_lines() -> None:
    assert json_text({"b": [1, "ä"], "a": [[0.5, None], [True]], "c": [{"d": 1}, {}], "e": []}) == (
        '{\n "a": [\n  [0.5, null],\n  [true]\n ],\n "b": [1, "ä"],\n'
        ' "c": [\n  {\n   "d": 1\n  },\n  {}\n ],\n "e": []\n}\n'
    )


@pytest.mark.parametrize("document", [{"a": 1.0, "b": {"c": "d"}}, {"b": [{"c": 1}, {"d": {}}]}])
def test_without_lists_of_plain_values_it_is_the_indented_form(document: Any) -> None:
    assert json_text(document) == json.dumps(document, indent=1, sort_keys=True) + "\n"


@pytest.mark.parametrize("value", [float("nan"), float("-inf")])
def test_numbers_that_are_not_finite_are_refused(value: float) -> None:
    for document in (value, [value], [[1.0, value]], {"a": value}):
        with pytest.raises(ValueError, match="not JSON compliant"):
            json_text(document)
