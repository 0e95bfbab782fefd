"""A drive's images and the labels its team drew on them."""

from pathlib import Path

import numpy as np
from PIL import Image

from card.artifacts import progress, write_table
from card.recording.paths import image_path
from card.simulation.camera import Camera
from card.simulation.labels import CLASSES, Box, private_boxes, road_boxes, yolo_lines
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CAMERAS, STEREO_DELAY_NS
from card.simulation.shading import Shader
from card.simulation.world import World

_FRAME_NS = 100_000_000
_QUALITY = 92
#: One image in so many was not looked at by the annotators.
_UNREVIEWED_EVERY = 7


def write_photographs(world: World, tracer: Tracer, ego: Scene, recording: Path, truth: Path) -> None:
    """Images of both cameras, ``annotations/``, ``privacy_labels.csv``, and the truth's ``boxes.parquet``."""
    shader = Shader(tracer, world.things, world.drive.section, world.sun)
    first = world.start_ns + round(world.scale.camera_start_s * 1e9)
    times = [first + k * _FRAME_NS for k in range(round(world.scale.camera_duration_s * 10))]
    found: list[tuple[str, int, Box]] = []
    for name in CAMERAS:
        model, pose = world.rig.cameras[name], world.rig.rig_from[name]
        camera, noise = Camera(model, pose, ego, world.sun), world.rng(f"noise of {name}")
        delay = STEREO_DELAY_NS if name == "camera_right" else 0
        (recording / name).mkdir(parents=True)
        for t_ns in progress([t + delay for t in times], f"{world.name} {name}"):
            world_from_rig = world.path.at(t_ns)
            picture = camera.shoot(tracer, shader, world_from_rig, t_ns, noise)
            Image.fromarray(picture.rgb).save(
                image_path(recording, name, t_ns), quality=_QUALITY, subsampling="4:2:0"
            )
            boxes = private_boxes(picture.thing, world.things)
            boxes += road_boxes(picture.thing, world.road, model, world_from_rig @ pose)
            found += [(name, t_ns, box) for box in boxes]
    _write_annotations(world, times, found, recording / "annotations")
    _write_privacy_labels(found, recording / "privacy_labels.csv")
    columns = {
        "camera": [name for name, _, _ in found],
        "t_ns": np.array([t for _, t, _ in found], np.int64),
        **{key: [getattr(box, key) for _, _, box in found] for key in Box.__dataclass_fields__},
    }
    write_table(truth / "boxes.parquet", columns, "truth_boxes")


def _write_annotations(
    world: World, times: list[int], found: list[tuple[str, int, Box]], folder: Path
) -> None:
    (folder / "labels").mkdir(parents=True)
    (folder / "classes.txt").write_text("".join(f"{name}\n" for name in CLASSES), encoding="utf-8")
    model = world.rig.cameras["camera_left"]
    for index, t_ns in enumerate(times):
        if index % _UNREVIEWED_EVERY == _UNREVIEWED_EVERY - 3:
            continue
        boxes = [b for name, t, b in found if name == "camera_left" and t == t_ns and b.kind in CLASSES]
        text = "".join(f"{line}\n" for line in yolo_lines(boxes, model))
        (folder / "labels" / f"{t_ns}.txt").write_text(text, encoding="utf-8")


def _write_privacy_labels(found: list[tuple[str, int, Box]], path: Path) -> None:
    lines = ["camera,t_ns,kind,x_min,y_min,x_max,y_max"]
    for name, t_ns, box in found:
        if box.kind not in CLASSES:
            edges = ",".join(f"{v:.1f}" for v in (box.x_min, box.y_min, box.x_max, box.y_max))
            lines.append(f"{name},{t_ns},{box.kind},{edges}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
