"""What is odd about tables of results: saturated accuracies, rows that agree or differ where they should not.

A table maps methods to values, values to keys ``<metric>/<region>``. Tables with the same numbers in another
scaling, or the same method printed twice, are compared with each other.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence

Values = Mapping[str, float | None]
Table = Mapping[str, Values]

DELTA_3_RATIO = 1.25**3
#: A prediction whose ratio is beyond 1.25^3 errs by at least this share of the true depth (it is too near).
LEAST_ERROR = 1 - 1 / DELTA_3_RATIO
#: Methods that must share a ceiling, and values that rows must share, before they are odd.
SHARED_CEILING, IDENTICAL_VALUES = 3, 4


def lint_tables(
    tables: Mapping[str, Table],
    nearest_m: float,
    digits: int = 3,
    same: Sequence[tuple[str, str]] = (),
) -> list[str]:
    """Findings, one line each; empty for tables without oddities.

    Parameters
    ----------
    tables : by name; ``None`` is no value. nearest_m : no pixel of any region is nearer, metres.
    digits : decimals in print, beyond which values are not compared.
    same : pairs of tables in which a method's values should agree wherever both have them. In any other pair
        a method whose rows are identical is reported.
    """
    findings: list[str] = []
    for name, table in tables.items():
        findings += _saturated(name, table, digits)
        findings += _inconsistent(name, table, nearest_m, digits)
        findings += _twins(name, table, digits)
    names = list(tables)
    for index, first in enumerate(names):
        for second in names[index + 1 :]:
            agree = (first, second) in same or (second, first) in same
            findings += _across(first, tables[first], second, tables[second], digits, agree)
    return findings


def _saturated(name: str, table: Table, digits: int) -> Iterator[str]:
    """A best value below 1 that several methods share looks like a share of samples that nobody can win."""
    columns: dict[str, list[float]] = defaultdict(list)
    for values in table.values():
        for key, value in values.items():
            if "delta" in key and value is not None:
                columns[key].append(round(value, digits))
    for key, column in columns.items():
        best = max(column)
        if best < 1 and column.count(best) >= SHARED_CEILING:
            yield (
                f"{name}, {key}: {column.count(best)} methods share the best value {best:.{digits}f}; the "
                f"missing {1 - best:.{digits}f} may be samples that every method fails, such as empty boxes"
            )


def _inconsistent(name: str, table: Table, nearest_m: float, digits: int) -> Iterator[str]:
    """Each pixel beyond delta 3 adds at least (1 - 1.25^-3)^2 d to the sum behind SqRel."""
    half = 0.5 * 10.0**-digits
    for method, values in table.items():
        for region in ("full", "boxes"):
            accuracy, error = values.get(f"delta_3/{region}"), values.get(f"sq_rel/{region}")
            if accuracy is None or error is None:
                continue
            least = (1 - accuracy - half) * LEAST_ERROR**2 * nearest_m
            if error + half < least:
                yield (
                    f"{name}, {method}, {region}: SqRel {error:.{digits}f} m is too small for delta 3 "
                    f"{accuracy:.{digits}f}, which makes it at least {least:.{digits}f} m"
                )


def _twins(name: str, table: Table, digits: int) -> Iterator[str]:
    """Two methods with the same row."""
    methods = list(table)
    for index, first in enumerate(methods):
        for second in methods[index + 1 :]:
            compared, equal = _compare(table[first], table[second], digits)
            if compared >= IDENTICAL_VALUES and equal == compared:
                yield f"{name}: the rows of {first} and {second} are identical"


def _across(first: str, one: Table, second: str, other: Table, digits: int, agree: bool) -> Iterator[str]:
    for method in one:
        if method not in other:
            continue
        compared, equal = _compare(one[method], other[method], digits)
        if compared < IDENTICAL_VALUES:
            continue
        if agree and equal < compared:
            yield f"{method}: {compared - equal} of {compared} values differ between {first} and {second}"
        if not agree and equal == compared:
            yield f"{method}: the rows of {first} and {second} are identical"


def _compare(one: Values, other: Values, digits: int) -> tuple[int, int]:
    """How many values both rows have, and how many of them agree in print."""
    both = [(one[key], other[key]) for key in one if key in other]
    pairs = [(a, b) for a, b in both if a is not None and b is not None]
    return len(pairs), sum(f"{a:.{digits}f}" == f"{b:.{digits}f}" for a, b in pairs)
