"""Whether a calibration can be used: the limits that its figures keep."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Limit:
    """A figure and the most it may be."""

    figure: str
    value: float
    most: float


def verdict(*limits: Limit) -> dict[str, Any]:
    """Passed, or the reasons why not: figure, value, limit.  NaN does not pass."""
    broken = [limit for limit in limits if not limit.value <= limit.most]
    return {
        "passed": not broken,
        "reasons": [f"{limit.figure} {limit.value:.4g}, at most {limit.most:g}" for limit in broken],
    }
