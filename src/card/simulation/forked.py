"""Work shared out to processes; what comes of it does not depend on how many there are."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

import cv2

Task = TypeVar("Task")
Result = TypeVar("Result")

# Set before the processes fork: they inherit it, nothing is pickled.
_inherited: list[Callable[[Any], Any]] = []


def shared_out(work: Callable[[Task], Result], tasks: Sequence[Task], threads: int) -> Iterator[Result]:
    """Results of `work` on each task, in the order of the tasks, by so many processes.

    The processes are forked, so `work` may hold anything but what has threads of its own: a ray casting
    scene, for one, has to be made within.
    """
    if threads < 2 or len(tasks) < 2:
        yield from map(work, tasks)
        return
    # OpenCV's own threads would not survive the fork.
    cv2.setNumThreads(1)
    _inherited.append(work)
    try:
        with ProcessPoolExecutor(min(threads, len(tasks)), mp_context=get_context("fork")) as pool:
            yield from pool.map(_run, tasks)
    finally:
        _inherited.pop()


def _run(task: Any) -> Any:
    return _inherited[-1](task)
