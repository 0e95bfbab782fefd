"""Fields of JSON objects, with an issue for what is missing or of another type."""

from typing import Any

from card.annotations.formats.collector import Collector
from card.annotations.formats.json_lines import Object


class Fields:
    """Typed access to the objects of one file."""

    def __init__(self, found: Collector, file: str) -> None:
        self._found = found
        self._file = file

    def text(self, holder: Object, key: str) -> str | None:
        """A string."""
        value = self._value(holder, key)
        if isinstance(value, str):
            return value
        self._wrong(holder, key, value, "a string")
        return None

    def number(self, holder: Object, key: str) -> float | None:
        """A number; NaN and infinities are left to the checks of the box."""
        value = self._value(holder, key)
        return self._number(holder, key, value)

    def numbers(self, holder: Object, key: str, count: int) -> tuple[float, ...] | None:
        """A list of ``count`` numbers."""
        values = self._value(holder, key)
        if not isinstance(values, list):
            self._wrong(holder, key, values, "a list")
            return None
        if len(values) != count:
            message = f"found {len(values)} numbers in {key}, wanted {count}"
            self._found.issue(self._file, holder.line, "field_count", message)
            return None
        numbers = [self._number(holder, key, value) for value in values]
        there = tuple(number for number in numbers if number is not None)
        return there if len(there) == count else None

    def identity(self, holder: Object, key: str) -> int | None:
        """A whole number; one that is written as ``1.0`` is repaired."""
        value = self._value(holder, key)
        if isinstance(value, float) and value.is_integer():
            self._found.issue(self._file, holder.line, "float_class", f"found {value}, wanted {int(value)}")
            return int(value)
        if isinstance(value, bool) or not isinstance(value, int):
            self._wrong(holder, key, value, "a whole number")
            return None
        return value

    def object(self, holder: Object, key: str) -> Object | None:
        """An object."""
        value = self._value(holder, key)
        if isinstance(value, Object):
            return value
        self._wrong(holder, key, value, "an object")
        return None

    def objects(self, holder: Object, key: str) -> list[Object]:
        """A list of objects; what is none is left out, with an error."""
        values = self._value(holder, key)
        if not isinstance(values, list):
            self._wrong(holder, key, values, "a list")
            return []
        for value in values:
            if not isinstance(value, Object):
                self._wrong(holder, key, value, "a list of objects")
                break
        return [value for value in values if isinstance(value, Object)]

    def _value(self, holder: Object, key: str) -> Any:
        if key not in holder:
            self._found.issue(self._file, holder.line, "missing_field", f"{key} is missing")
        return holder.get(key)

    def _number(self, holder: Object, key: str, value: Any) -> float | None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            self._wrong(holder, key, value, "a number", "not_a_number")
            return None
        try:
            return float(value)
        except OverflowError:
            return float("inf")

    def _wrong(self, holder: Object, key: str, value: Any, wanted: str, code: str = "wrong_type") -> None:
        # What is missing has been noted already.
        if key in holder:
            shown = "null" if value is None else f"{value!r}"[:40]
            self._found.issue(self._file, holder.line, code, f"found {shown} as {key}, wanted {wanted}")
