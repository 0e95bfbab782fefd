"""A box found in one image is looked for in its neighbours, so that one missed frame undoes nothing.

Static things are where depth and poses say, moving ones where their track leads; both are then looked for
by their own pixels. What two images show is redacted in the next even where its pixels do not confirm it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.privacy.detection import Detection
from card.privacy.sight import Edges, Sight
from card.privacy.tables import Image

Grey = NDArray[np.uint8]

# Depths, m, tried in the partner's image for a box of unknown depth.
_DEPTHS = (np.inf, 40.0, 20.0, 12.0, 8.0, 5.0)
# A patch says where it is if it has this many pixels a side and contrast (grey levels, one sigma).
_MIN_PATCH_PX, _MIN_CONTRAST = 6, 3.0
_SLACK_PX = 8.0
# Two boxes of a track differ by no more than this factor in size from one image to the next.
_TRACK_GROWTH = 1.5


class Propagation:
    """Carries boxes from image to image.

    Parameters
    ----------
    boxes : what detectors found, by image (camera, t_ns).
    times : times of each camera's images, increasing.
    pairs : right image's time by left image's time.
    sight : cameras, poses and depth; without them things are looked for where they were, in the same camera.
    grey : pixels (H, W) uint8 of an image.
    settings : ``propagation`` of ``settings/privacy``.
    """

    def __init__(
        self,
        boxes: Mapping[Image, Sequence[Detection]],
        times: Mapping[str, Sequence[int]],
        pairs: Mapping[int, int],
        sight: Sight | None,
        grey: Callable[[Image], Grey],
        settings: Mapping[str, Any],
    ) -> None:
        self._boxes, self._times, self._sight = boxes, times, sight
        self._grey, self._settings = grey, settings
        self._place = {(camera, t): i for camera, all_t in times.items() for i, t in enumerate(all_t)}
        self._partner = {("camera_left", left): ("camera_right", right) for left, right in pairs.items()}
        self._partner |= {right: left for left, right in self._partner.items()}
        self._depths: dict[Image, list[float]] = {}

    def into(self, image: Image) -> list[Detection]:
        """Boxes that neighbours and the stereo partner add to what was found in the image itself."""
        added: list[Detection] = []
        shape = self._grey(image).shape
        for source, steps in self._sources(image):
            for number, box in enumerate(self._boxes.get(source, ())):
                name = "partner" if steps == 0 else "neighbour"
                for edges in self._places(source, number, image, steps):
                    there = replace(_with_edges(box, edges), source=name)
                    own = [*self._boxes.get(image, ()), *added]
                    if not _covered(edges, own, shape, self._settings["covered_share"]):
                        added.append(there)
        return added

    def _sources(self, image: Image) -> list[tuple[Image, int]]:
        """Images to take boxes from, each with how many images it lies back; 0 for the partner."""
        camera, _ = image
        place, times = self._place[image], self._times[camera]
        reach = self._settings["neighbours"]
        found = [
            ((camera, times[i]), place - i)
            for i in range(max(0, place - reach), min(len(times), place + reach + 1))
            if i != place
        ]
        if self._settings["stereo"] and self._sight is not None and image in self._partner:
            found.append((self._partner[image], 0))
        return found

    def _places(self, source: Image, number: int, target: Image, steps: int) -> list[Edges]:
        """Where a box of ``source`` is in ``target``: the best match, or all guesses if nothing matches."""
        box = self._boxes[source][number]
        guesses = self._guesses(source, number, target, steps)
        matches = [self._match(source, box.edges, target, guess) for guess in guesses]
        score, best = max(((m[0], m[1]) for m in matches if m), default=(-1.0, None))
        if best is not None and score >= self._settings["match_score"]:
            return [best]
        if steps == 0:
            return guesses if np.isfinite(self._depth(source)[number]) else []
        # A box that no neighbour has may be a slip of the detector: its pixels must be found.
        return guesses if self._confirmed(source, number) else []

    def _confirmed(self, source: Image, number: int) -> bool:
        """Whether the image before or after, of the same camera, has a box that may be the same thing."""
        camera, _ = source
        place, times = self._place[source], self._times[camera]
        beside = [times[i] for i in (place - 1, place + 1) if 0 <= i < len(times)]
        box = self._boxes[source][number]
        return any(_linked(box, self._boxes.get((camera, t_ns), ())) is not None for t_ns in beside)

    def _guesses(self, source: Image, number: int, target: Image, steps: int) -> list[Edges]:
        edges = self._boxes[source][number].edges
        if self._sight is None:
            still = [edges]
        else:
            depth = self._depth(source)[number]
            depths = (depth,) if steps or np.isfinite(depth) else _DEPTHS
            moved = [self._sight.moved(edges, d, source, target) for d in depths]
            still = [place for place in moved if place is not None]
        tracked = self._tracked(source, number, steps) if steps else None
        return still if tracked is None else [*still, tracked]

    def _tracked(self, source: Image, number: int, steps: int) -> Edges | None:
        """Where a box is after ``steps`` images if it goes on as it came from the image before."""
        camera, _ = source
        before = self._place[source] - (1 if steps > 0 else -1)
        if not 0 <= before < len(self._times[camera]):
            return None
        box = self._boxes[source][number]
        earlier = _linked(box, self._boxes.get((camera, self._times[camera][before]), ()))
        if earlier is None:
            return None
        count = abs(steps)
        now, then = np.array(box.edges), np.array(earlier.edges)
        centre, size = (now[:2] + now[2:]) / 2, now[2:] - now[:2]
        centre = centre + count * (centre - (then[:2] + then[2:]) / 2)
        size = size * (size / (then[2:] - then[:2])) ** count
        left, top, right, bottom = np.concatenate([centre - size / 2, centre + size / 2]).tolist()
        return left, top, right, bottom

    def _depth(self, image: Image) -> list[float]:
        if self._sight is None:
            return [np.inf] * len(self._boxes.get(image, ()))
        if image not in self._depths:
            self._depths[image] = self._sight.depths(
                *image, [box.edges for box in self._boxes.get(image, ())]
            )
        return self._depths[image]

    def _match(self, source: Image, edges: Edges, target: Image, guess: Edges) -> tuple[float, Edges] | None:
        """Correlation and place of the box's pixels near a guess."""
        import cv2

        patch = _crop(self._grey(source), edges)[0]
        width, height = round(guess[2] - guess[0]), round(guess[3] - guess[1])
        if min(*patch.shape, width, height) < _MIN_PATCH_PX or patch.std() < _MIN_CONTRAST:
            return None
        share = self._settings["search_share"]
        dx, dy = share * width + _SLACK_PX, share * height + _SLACK_PX
        window, (left, top) = _crop(
            self._grey(target), (guess[0] - dx, guess[1] - dy, guess[2] + dx, guess[3] + dy)
        )
        if window.shape[0] < height or window.shape[1] < width:
            return None
        patch = np.asarray(cv2.resize(patch, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        scores = cv2.matchTemplate(window, patch, cv2.TM_CCOEFF_NORMED)
        _, score, _, (x, y) = cv2.minMaxLoc(scores)
        x_min, y_min = left + x - 0.5, top + y - 0.5
        return float(score), (x_min, y_min, x_min + width, y_min + height)


def _linked(box: Detection, others: Sequence[Detection]) -> Detection | None:
    """The nearest box of the same kind and about the same size, no further away than its size."""
    best, nearest = None, 2.0 * max(box.size)
    for other in others:
        ratios = np.array(box.size) / other.size
        distance = float(
            np.hypot(*(np.add(box.edges[:2], box.edges[2:]) - np.add(other.edges[:2], other.edges[2:])))
        )
        alike = other.kind == box.kind and ratios.max() < _TRACK_GROWTH and ratios.min() > 1 / _TRACK_GROWTH
        if alike and distance / 2 < nearest:
            best, nearest = other, distance / 2
    return best


def _with_edges(box: Detection, edges: Edges) -> Detection:
    return replace(box, x_min=edges[0], y_min=edges[1], x_max=edges[2], y_max=edges[3])


def _crop(image: Grey, edges: Edges) -> tuple[Grey, tuple[int, int]]:
    """Pixels whose centres lie in a box, and the column and row of the first; empty outside the image."""
    left, top = max(0, int(np.ceil(edges[0]))), max(0, int(np.ceil(edges[1])))
    right, bottom = max(0, int(np.floor(edges[2])) + 1), max(0, int(np.floor(edges[3])) + 1)
    return image[top:bottom, left:right], (left, top)


def _covered(edges: Edges, boxes: Sequence[Detection], shape: tuple[int, ...], share: float) -> bool:
    """Whether this share of a box's pixels lies in the union of others, or all of it outside the image."""
    probe, (left, top) = _crop(np.zeros(shape, dtype=np.uint8), edges)
    if not probe.size:
        return True
    for box in boxes:
        x_min, y_min, x_max, y_max = (np.array(box.edges) - (left, top, left, top)).tolist()
        _crop(probe, (x_min, y_min, x_max, y_max))[0][:] = 1
    return bool(probe.mean() >= share)
