"""Do times go forward without holes?"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from card.errors import CardError


def largest_gap_ns(sensor: str, t_ns: npt.NDArray[np.int64], limit_ns: int, where: object) -> int:
    """Largest step of (N,) increasing times; 0 for fewer than two.

    Raises CardError where a step exceeds `limit_ns`.
    """
    steps = np.diff(t_ns)
    if not len(steps):
        return 0
    worst = int(steps.argmax())
    if steps[worst] > limit_ns:
        raise CardError(
            f"times of {sensor} jump",
            where=where,
            found=f"{steps[worst] / 1e9:.3f} s after {t_ns[worst]}",
            wanted=f"at most {limit_ns / 1e9:g} s",
        )
    return int(steps[worst])


def share_within(t_ns: npt.NDArray[np.int64], start_ns: int, end_ns: int) -> float:
    """Share of (N,) times between two others, both included; 0 for none."""
    return float(np.mean((t_ns >= start_ns) & (t_ns <= end_ns))) if len(t_ns) else 0.0
