"""What a piece of work costs."""

import resource
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """Seconds on the clock, and CPU-seconds, user and system, of this process's threads and its children."""

    wall_s: float
    cpu_s: float


def cpu_s(work: Callable[[], object], repeats: int) -> float:
    """CPU-seconds: the median of ``repeats``.

    On shared cores this repeats better than wall time; wall time on two cores is between half of it and it.
    """
    return cost(work, repeats).cpu_s


def cost(work: Callable[[], object], repeats: int) -> Cost:
    """Wall and CPU time, each the median of ``repeats``."""
    walls, cpus = zip(*(_once(work) for _ in range(repeats)), strict=True)
    return Cost(statistics.median(walls), statistics.median(cpus))


def _once(work: Callable[[], object]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), _spent()
    work()
    return time.perf_counter() - wall, _spent() - cpu


def _spent() -> float:
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)
