"""Work shared out to processes: in order, with its errors, and safe to fork."""

import os
import time
from concurrent.futures import ProcessPoolExecutor

import cv2
import numpy as np
import pytest

from card.artifacts import processes
from card.artifacts.processes import in_processes
from card.errors import CardError

prepared: list[int] = []


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_results_come_in_the_order_of_the_tasks(threads: int) -> None:
    def late_first(task: int) -> int:
        time.sleep(0.05 * (task == 0))
        return task * task

    assert list(in_processes(late_first, range(4), threads)) == [0, 1, 4, 9]
    assert list(in_processes(late_first, [], threads)) == []


def test_one_process_is_this_one_unless_it_is_to_be_prepared() -> None:
    here = os.getpid()
    assert set(in_processes(lambda _: os.getpid(), range(3), 1)) == {here}
    assert here not in set(in_processes(lambda _: os.getpid(), range(3), 2))
    assert here not in set(in_processes(lambda _: os.getpid(), range(3), 1, prepare=lambda: None))


def test_each_process_is_prepared_once_and_this_one_never() -> None:
    def count(_: int) -> tuple[int, int]:
        return os.getpid(), len(prepared)

    seen = list(in_processes(count, range(6), 2, prepare=lambda: prepared.append(1)))
    assert {times for _, times in seen} == {1}
    assert prepared == []


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("where", ["work", "prepare"])
def test_an_error_arrives_as_it_was_raised(threads: int, where: str) -> None:
    def fail() -> None:
        raise CardError("image is missing", where="camera_left/5.jpg", found="nothing", wanted="a JPEG")

    def work(task: int) -> int:
        if task == 1 and where == "work":
            fail()
        return task

    with pytest.raises(CardError) as caught:
        list(in_processes(work, range(3), threads, prepare=fail if where == "prepare" else None))
    assert str(caught.value) == "camera_left/5.jpg: image is missing (found nothing, wanted a JPEG)"


def test_opencv_has_no_threads_when_the_processes_fork(monkeypatch: pytest.MonkeyPatch) -> None:
    cv2.setNumThreads(4)
    image = np.zeros((1200, 1600), np.uint8)
    cv2.GaussianBlur(image, (31, 31), 5)  # wakes the threads
    at_fork = []

    class Watched(ProcessPoolExecutor):
        def __init__(self, *args: object, **keywords: object) -> None:
            at_fork.append(cv2.getNumThreads())
            super().__init__(*args, **keywords)

    monkeypatch.setattr(processes, "ProcessPoolExecutor", Watched)
    blurred = in_processes(lambda _: cv2.GaussianBlur(image, (31, 31), 5).shape, range(2), 2)
    assert list(blurred) == [image.shape] * 2
    assert at_fork == [1]
