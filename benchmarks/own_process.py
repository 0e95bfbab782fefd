"""Work in a process of its own, so that what it takes is what it alone takes."""

import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")


@dataclass(frozen=True)
class Spent:
    """CPU-seconds of a process and of its children, seconds on the clock with its start, and peaks of memory
    in GB: of the process and of the greatest child. What a child shares with it counts in both."""

    own_s: float
    children_s: float
    wall_s: float
    peak_gb: float
    child_peak_gb: float


def alone(work: Callable[..., Result], *arguments: object) -> tuple[Result, Spent]:
    """What `work`, a function of a module, returns in a new process, and what that process spent.

    The main module is imported there too, so a script needs its guard.
    """
    start = time.perf_counter()
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        result, own, children, peak, child_peak = pool.submit(_measured, work, arguments).result()
    return result, Spent(own, children, time.perf_counter() - start, peak, child_peak)


def peak_gb() -> float:
    """Peak memory of this process up to now, GB.

    `getrusage` would give that of the process which started it if that was greater.
    """
    lines = Path("/proc/self/status").read_text().splitlines()
    (peak,) = (line.split()[1] for line in lines if line.startswith("VmHWM:"))
    return int(peak) * 1024 / 1e9


def _measured(
    work: Callable[..., Result], arguments: tuple[object, ...]
) -> tuple[Result, float, float, float, float]:
    result = work(*arguments)
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    own, children = (usage.ru_utime + usage.ru_stime for usage in usages)
    return result, own, children, peak_gb(), usages[1].ru_maxrss * 1024 / 1e9
