"""The frames of a split that are evaluated, with all that the evaluation reads of the release."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from card.benchmark.frame_scores import Evaluated, evaluated_pixels, slopes
from card.benchmark.image_space import ImageSpace, image_space
from card.benchmark.predictions import Frame, find_predictions, read_prediction
from card.benchmark.truth import View
from card.errors import CardError
from card.geometry import CameraModel
from card.packaging.reader import SPLITS, Release
from card.packaging.reader.rig import Rig

Row = Mapping[str, Any]
T = TypeVar("T")

#: Frames at work at the same time. Decompression and the compiled forms let go of the interpreter's lock.
WORKERS = 2

#: Classes of the label boxes by their number in a label file.
CLASSES = ("positive", "negative")


@dataclass(frozen=True)
class Method:
    """What is evaluated: name, folder of predictions, the image they are for, metres that 1 in a file means.

    unit_m : None is 1, and 1/256 in a PNG.
    """

    name: str
    predictions: Path
    space: str = "original"
    unit_m: float | None = None


@dataclass(frozen=True)
class Selection:
    """The rows of a split that are evaluated, and how many are not, by reason."""

    rows: Sequence[Row]
    files: Mapping[Frame, Path]
    without_truth: int
    below_coverage: int


@dataclass(frozen=True)
class SequenceView:
    """What the frames of one sequence share: rig, view of the left camera, image that is predicted."""

    rig: Rig
    view: View
    space: ImageSpace


@dataclass(frozen=True)
class Loaded:
    """One frame as read: ground truth (N, 3), label boxes (class, x, y, w, h), road, prediction (H, W).

    road_from_camera : (4, 4), None where the frame has no valid road plane.
    """

    row: Row
    points: NDArray[np.float32]
    boxes: Sequence[Sequence[float]]
    road_from_camera: NDArray[np.float64] | None
    prediction: Any


def key(row: Row) -> Frame:
    """Sequence and number of a frame."""
    return row["sequence"], row["frame"]


def select(release: Release, split: str, method: Method, flags: Sequence[str]) -> Selection:
    """The frames of a split whose ground truth has a flag in ``flags``, and their predictions."""
    if split not in SPLITS:
        raise CardError("unknown split", found=split, wanted=" or ".join(SPLITS))
    rows = release.frames(split)
    with_truth = [row for row in rows if row["has_ground_truth"]]
    chosen = [row for row in with_truth if row["gt_flag"] in flags]
    files = find_predictions(method.predictions, map(key, chosen), map(key, rows))
    return Selection(chosen, files, len(rows) - len(with_truth), len(with_truth) - len(chosen))


class SequenceViews:
    """Views of a release's sequences, one at a time; sequences of one session share their camera's rays."""

    def __init__(self, release: Release, space: str) -> None:
        self._release, self._space = release, space
        self._views: dict[CameraModel, View] = {}
        self._current: tuple[str, SequenceView] | None = None

    def of(self, sequence: str) -> SequenceView:
        """The view of a sequence."""
        if self._current is None or self._current[0] != sequence:
            self._current = (sequence, self._open(sequence))
        return self._current[1]

    def _open(self, sequence: str) -> SequenceView:
        rig = self._release.rig(sequence)
        camera = rig.camera("camera_left")
        if camera not in self._views:
            # One camera's rays at a time: they are large.
            self._views = {camera: View(camera)}
            _ = self._views[camera].rays  # before threads ask for them
        return SequenceView(rig, self._views[camera], image_space(self._space, rig))


def load(release: Release, row: Row, path: Path, method: Method, view: SequenceView) -> Loaded:
    """Read one frame and its prediction."""
    other = image_space(method.space, view.rig, "camera_right")
    return Loaded(
        row,
        release.points(*key(row)),
        release.boxes(*key(row)) or (),
        release.road(*key(row)),
        read_prediction(path, view.space, (other,), method.unit_m),
    )


def evaluated(frame: Loaded, view: SequenceView, settings: Mapping[str, Any]) -> tuple[Evaluated, int]:
    """The pixels of a frame that count, and how many more the predicted image does not see."""
    limits = (settings["min_depth_m"], settings["max_depth_m"])
    pixels, truth = view.view.truth(frame.points, limits)
    road = frame.road_from_camera
    if view.space.name == "original":
        return evaluated_pixels(view.view, pixels, truth, frame.prediction, road), 0
    rays = view.view.rays[pixels]
    depth, seen = view.space.sample(frame.prediction, rays)
    given = Evaluated(pixels, truth, depth, slopes(rays, road))
    return given.part(seen), int(np.count_nonzero(~seen))


def each_frame(
    release: Release,
    selection: Selection,
    method: Method,
    views: SequenceViews,
    work: Callable[[Loaded, SequenceView], T],
) -> Iterator[T]:
    """What ``work`` gives for each frame, in their order; a few are read and worked on at the same time."""

    def one(row: Row, view: SequenceView) -> T:
        return work(load(release, row, selection.files[key(row)], method, view), view)

    waiting: deque[Future[T]] = deque()
    with ThreadPoolExecutor(WORKERS) as pool:
        for row in selection.rows:
            waiting.append(pool.submit(one, row, views.of(row["sequence"])))
            if len(waiting) > WORKERS:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
