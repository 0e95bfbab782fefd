"""A drive's images and the labels its team drew on them."""

from pathlib import Path

import numpy as np

from card.artifacts import write_table
from card.recording.paths import image_path
from card.simulation.camera import Camera
from card.simulation.exposure import jpeg
from card.simulation.labels import CLASSES, Box, private_boxes, road_boxes, yolo_lines
from card.simulation.occlusion import with_shares
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CAMERAS, STEREO_DELAY_NS
from card.simulation.shading import Shader
from card.simulation.world import World

_FRAME_NS = 100_000_000
#: One image in so many was not looked at by the annotators.
_UNREVIEWED_EVERY = 7

#: Camera, time in ns, and a box in its image.
Shown = tuple[str, int, Box]


def exposures(world: World, camera: str) -> list[int]:
    """Times (ns) of all images of a camera."""
    first = world.start_ns + round(world.scale.camera_start_s * 1e9)
    first += STEREO_DELAY_NS if camera == "camera_right" else 0
    return [first + k * _FRAME_NS for k in range(round(world.scale.camera_duration_s * 10))]


class Photographer:
    """Both cameras of a world's car."""

    def __init__(self, world: World, tracer: Tracer, ego: Scene) -> None:
        self._world = world
        shader = Shader(tracer, world.things, world.drive.section)
        self._cameras = {name: Camera(world, tracer, shader, ego, name) for name in CAMERAS}

    def photograph(self, name: str, numbers: range, recording: Path) -> list[Shown]:
        """Write images ``numbers`` of one camera; what a label could be drawn around in them."""
        world, found = self._world, []
        for number in numbers:
            t_ns, noise = exposures(world, name)[number], world.rng(f"noise of {name} {number}")
            picture = self._cameras[name].shoot(t_ns, noise)
            image_path(recording, name, t_ns).write_bytes(jpeg(picture.rgb))
            boxes = private_boxes(picture.thing, world.things)
            boxes += road_boxes(picture.thing, world.road)
            found += [(name, t_ns, box) for box in boxes]
        return found


def write_labels(world: World, found: list[Shown], recording: Path, truth: Path) -> None:
    """``annotations/``, ``privacy_labels.csv`` and the truth's ``boxes.parquet`` of all images."""
    found = with_shares(world, found)
    _write_annotations(world, found, recording / "annotations")
    _write_privacy_labels(found, recording / "privacy_labels.csv")
    columns = {
        "camera": [name for name, _, _ in found],
        "t_ns": np.array([t for _, t, _ in found], np.int64),
        **{key: [getattr(box, key) for _, _, box in found] for key in Box.__dataclass_fields__},
    }
    write_table(truth / "boxes.parquet", columns, "truth_boxes")


def _write_annotations(world: World, found: list[Shown], folder: Path) -> None:
    (folder / "labels").mkdir(parents=True)
    (folder / "classes.txt").write_text("".join(f"{name}\n" for name in CLASSES), encoding="utf-8")
    model = world.rig.cameras["camera_left"]
    for index, t_ns in enumerate(exposures(world, "camera_left")):
        if index % _UNREVIEWED_EVERY == _UNREVIEWED_EVERY - 3:
            continue
        boxes = [b for name, t, b in found if name == "camera_left" and t == t_ns and b.kind in CLASSES]
        text = "".join(f"{line}\n" for line in yolo_lines(boxes, model))
        (folder / "labels" / f"{t_ns}.txt").write_text(text, encoding="utf-8")


def _write_privacy_labels(found: list[Shown], path: Path) -> None:
    lines = ["camera,t_ns,kind,x_min,y_min,x_max,y_max"]
    for name, t_ns, box in found:
        if box.kind not in CLASSES:
            edges = ",".join(f"{v:.1f}" for v in (box.x_min, box.y_min, box.x_max, box.y_max))
            lines.append(f"{name},{t_ns},{box.kind},{edges}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
