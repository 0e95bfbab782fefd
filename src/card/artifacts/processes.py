"""Work shared out to processes; what comes of it does not depend on how many there are."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

import cv2

Task = TypeVar("Task")
Result = TypeVar("Result")


def in_processes(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    threads: int,
    *,
    prepare: Callable[[], None] | None = None,
) -> Iterator[Result]:
    """Results of `work` on each task, in the order of the tasks, by up to so many processes.

    The processes are forked: `work` and `prepare` are inherited, not pickled, and may hold anything but what
    has threads of its own (a ray casting scene, a model), which has to be made within. If one is enough, it
    is this one.

    Parameters
    ----------
    prepare : called by each process before its first task. It may change the process, so then none of the
        work is done in this one.

    Raises
    ------
    Exception
        What `work` or `prepare` raised on the first task, in their order, that failed.
    """
    if not tasks:
        return
    # One thread keeps sums in one order and shares the cores with the other processes. It is set before the
    # fork: a child cannot end threads that it did not inherit, and would wait for them for ever.
    cv2.setNumThreads(1)
    if prepare is None and (threads < 2 or len(tasks) < 2):
        yield from map(work, tasks)
        return
    # Forked workers need no importable main module, which a workflow's script does not have.
    pool = ProcessPoolExecutor(
        max(1, min(threads, len(tasks))),
        mp_context=get_context("fork"),
        initializer=_inherit,
        initargs=(work, prepare),
    )
    with pool:
        yield from pool.map(_run, tasks)


# What a forked process was given.
_work: Callable[[Any], Any]
_prepare: Callable[[], None] | None


def _inherit(work: Callable[[Any], Any], prepare: Callable[[], None] | None) -> None:
    global _work, _prepare
    _work, _prepare = work, prepare


def _run(task: Any) -> Any:
    global _prepare
    # Here and not before: an initializer that fails only tells that the pool is broken.
    if _prepare is not None:
        _prepare()
        _prepare = None
    return _work(task)
