"""Boxes carried to neighbouring images: static things by depth and pose, moving ones by track and pixels."""

import numpy as np
import pytest

from card.artifacts import default_settings
from card.privacy.detection import Detection
from card.privacy.propagate import Propagation

SETTINGS = default_settings("privacy")["propagation"]
HEIGHT, WIDTH = 200, 320
STEP_NS = 100_000_000


class Shifted:
    """A scene at one depth: pixels move by `per_frame` an image, and by `disparity` to the right camera."""

    def __init__(self, per_frame: float, disparity: float, depth: float = 10.0) -> None:
        self.per_frame, self.disparity, self.depth = per_frame, disparity, depth

    def depths(self, camera, t_ns, boxes):
        return [self.depth] * len(boxes)

    def moved(self, edges, depth, start, end):
        scale = self.depth / depth if np.isfinite(depth) else 0.0
        shift = scale * (self._place(*end) - self._place(*start))
        return edges[0] + shift, edges[1], edges[2] + shift, edges[3]

    def _place(self, camera, t_ns):
        return self.per_frame * t_ns / STEP_NS - (self.disparity if camera == "camera_right" else 0)


def texture(seed: int, size: int = 24) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (size, size), dtype=np.uint8)


def scene(places: dict[tuple[str, int], tuple[int, int]], seed: int = 1) -> dict[tuple[str, int], np.ndarray]:
    """Images by (camera, t_ns), each with the same patch at column, row."""
    images = {}
    for number, (image, (x, y)) in enumerate(places.items()):
        pixels = np.random.default_rng(100 + number).integers(90, 130, (HEIGHT, WIDTH), dtype=np.uint8)
        pixels[y : y + 24, x : x + 24] = texture(seed)
        images[image] = pixels
    return images


def at(x: float, y: float, kind: str = "face", size: float = 24) -> Detection:
    return Detection(kind, x - 0.5, y - 0.5, x + size - 0.5, y + size - 0.5, 0.9, "model", "hash")


def propagation(images, boxes, sight=None, **settings) -> Propagation:
    times = {}
    for camera, t_ns in images:
        times.setdefault(camera, []).append(t_ns)
    pairs = {t: t for t in times.get("camera_right", ()) if t in times["camera_left"]}
    return Propagation(boxes, times, pairs, sight, images.__getitem__, SETTINGS | settings)


def left(k: int) -> tuple[str, int]:
    return "camera_left", k * STEP_NS


def test_a_static_face_missed_in_one_image_is_covered_by_pose_and_depth():
    places = {left(k): (40 + 15 * k, 60) for k in range(4)}
    boxes = {left(k): [at(40 + 15 * k, 60)] for k in (0, 1, 3)}
    (found,) = propagation(scene(places), boxes, Shifted(15, 30)).into(left(2))
    assert found.edges == pytest.approx(at(70, 60).edges, abs=0.6)
    assert (found.source, found.model_sha256, found.kind) == ("neighbour", "hash", "face")


def test_a_moving_face_is_found_by_its_pixels_beside_its_static_place():
    places = {left(0): (100, 60), left(1): (115, 66), left(2): (130, 72)}
    boxes = {left(0): [at(100, 60)]}
    found = propagation(scene(places), boxes, Shifted(0, 30), neighbours=1).into(left(1))
    assert [d.edges for d in found] == [pytest.approx(at(115, 66).edges, abs=0.6)]


def test_a_fast_car_is_found_by_its_track():
    # 60 px an image: far outside the search around where it was.
    places = {left(k): (20 + 60 * k, 60) for k in range(3)}
    boxes = {left(0): [at(20, 60, "plate")], left(1): [at(80, 60, "plate")]}
    tight = propagation(scene(places), boxes, Shifted(0, 30), neighbours=1, search_share=0.2)
    far = [d for d in tight.into(left(2)) if d.x_min > 130]
    assert not far  # a box moves by no more than twice its size between linked images
    boxes = {left(0): [at(20, 60, "plate", 40)], left(1): [at(80, 60, "plate", 40)]}
    linked = propagation(scene(places), boxes, Shifted(0, 30), neighbours=1, search_share=0.2)
    assert any(abs(d.x_min - 139.5) < 1 for d in linked.into(left(2)))


def test_the_stereo_partner_gets_the_box_at_its_depth():
    images = scene({left(0): (150, 60), ("camera_right", 0): (120, 60)})
    boxes = {left(0): [at(150, 60)]}
    (found,) = propagation(images, boxes, Shifted(0, 30)).into(("camera_right", 0))
    assert found.edges == pytest.approx(at(120, 60).edges, abs=0.6)
    assert found.source == "partner"
    assert not propagation(images, boxes, Shifted(0, 30), stereo=False).into(("camera_right", 0))


def test_without_depth_the_partner_is_searched_at_all_depths():
    class Blind(Shifted):
        def depths(self, camera, t_ns, boxes):
            return [np.inf] * len(boxes)

    images = scene({left(0): (150, 60), ("camera_right", 0): (126, 60)})
    boxes = {left(0): [at(150, 60)]}
    (found,) = propagation(images, boxes, Blind(0, 30)).into(("camera_right", 0))
    assert found.edges == pytest.approx(at(126, 60).edges, abs=0.6)


def test_where_the_pixels_do_not_agree_what_two_images_show_is_redacted_all_the_same():
    blank = {left(2): np.full((HEIGHT, WIDTH), 110, dtype=np.uint8)}
    images = scene({left(0): (93, 60), left(1): (100, 60)}) | blank
    boxes = {left(0): [at(93, 60)], left(1): [at(100, 60)]}
    found = propagation(images, boxes, Shifted(7, 0), neighbours=1).into(left(2))
    assert found[0].edges == pytest.approx(at(107, 60).edges)
    # One box alone may be a slip of the detector.
    assert propagation(images, {left(1): [at(100, 60)]}, Shifted(7, 0), neighbours=1).into(left(2)) == []


def test_what_is_redacted_already_is_not_redacted_twice():
    places = {left(k): (100, 60) for k in range(3)}
    boxes = {left(k): [at(100, 60)] for k in range(3)}
    assert propagation(scene(places), boxes, Shifted(0, 0)).into(left(1)) == []


def test_a_box_that_leaves_the_image_is_dropped():
    images = scene({left(0): (290, 60)}) | {left(1): np.full((HEIGHT, WIDTH), 110, dtype=np.uint8)}
    boxes = {left(0): [at(290, 60)]}
    assert propagation(images, boxes, Shifted(100, 0)).into(left(1)) == []


def test_without_poses_boxes_stay_where_they_were_in_their_own_camera():
    images = scene({left(0): (100, 60), left(1): (104, 60), ("camera_right", 0): (90, 60)})
    boxes = {left(0): [at(100, 60)]}
    carried = propagation(images, boxes)
    assert carried.into(left(1))[0].edges == pytest.approx(at(104, 60).edges, abs=0.6)
    assert carried.into(("camera_right", 0)) == []


def test_reach_is_a_setting():
    places = {left(k): (100, 60) for k in range(5)}
    boxes = {left(0): [at(100, 60)]}
    for reach, hits in ((0, 0), (1, 1), (3, 3)):
        carried = propagation(scene(places), boxes, Shifted(0, 0), neighbours=reach)
        assert sum(bool(carried.into(left(k))) for k in range(1, 5)) == hits
