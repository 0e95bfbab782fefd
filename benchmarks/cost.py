"""What a piece of work costs."""

import resource
import statistics
from collections.abc import Callable


def cpu_s(work: Callable[[], object], repeats: int) -> float:
    """CPU-seconds, user and system, of this process's threads and its children: the median of ``repeats``.

    On shared cores this repeats better than wall time; wall time on two cores is between half of it and it.
    """
    return statistics.median(_once(work) for _ in range(repeats))


def _once(work: Callable[[], object]) -> float:
    before = _spent()
    work()
    return _spent() - before


def _spent() -> float:
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)
