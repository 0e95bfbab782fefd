"""Boxes hold what is in sight and say how much is hidden, against rays at each thing alone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from card.simulation.labels import Box, private_boxes, road_boxes
from card.simulation.mesh import Mesh, join
from card.simulation.occlusion import Silhouettes, with_shares
from card.simulation.raycast import Scene, Tracer
from card.simulation.world import World, build_world

Array = NDArray[np.float64]
CAMERA = "camera_left"


@pytest.fixture(scope="module")
def world() -> World:
    return build_world("de_town_bumps", "demo", 1)


@pytest.fixture(scope="module")
def tracer(world: World) -> Tracer:
    return Tracer(world.static, world.movers)


def moments(world: World) -> list[int]:
    first = world.start_ns + round(world.scale.camera_start_s * 1e9)
    return [first + k * 100_000_000 for k in (5, 18, 42)]


def rays(world: World, t_ns: int) -> tuple[Array, Array]:
    """Origin (3,) and unit directions (N, 3) in world of all pixels, row after row."""
    model = world.rig.cameras[CAMERA]
    pose = world.path.at(t_ns) @ world.rig.rig_from[CAMERA]
    v, u = np.mgrid[0 : model.height, 0 : model.width]
    directions = model.rays(np.stack([u.ravel(), v.ravel()], axis=1).astype(float)) @ pose[:3, :3].T
    return pose[:3, 3], directions / np.linalg.norm(directions, axis=1, keepdims=True)


def seen(world: World, tracer: Tracer, t_ns: int) -> NDArray[np.int32]:
    origin, directions = rays(world, t_ns)
    hits = tracer.cast(np.broadcast_to(origin, directions.shape), directions, np.full(len(directions), t_ns))
    model = world.rig.cameras[CAMERA]
    thing = np.where(hits.triangle >= 0, tracer.all.thing[hits.triangle], -1)
    return thing.reshape(model.height, model.width).astype(np.int32)


def alone(world: World, thing: int, t_ns: int) -> int:
    """Pixels a thing would have if it were all there is."""
    meshes = [world.static, *(m.mesh.moved(m.path.at(t_ns)) for m in world.movers)]
    parts = [
        replace(
            m,
            triangles=m.triangles[m.thing == thing],
            surface=m.surface[m.thing == thing],
            tint=m.tint[m.thing == thing],
            thing=m.thing[m.thing == thing],
        )
        for m in meshes
        if (m.thing == thing).any()
    ]
    scene: Mesh = join(parts)
    return int(np.count_nonzero(Scene(scene).cast(*rays(world, t_ns)).triangle >= 0))


def boxes(world: World, tracer: Tracer, t_ns: int) -> tuple[NDArray[np.int32], list[Box]]:
    image = seen(world, tracer, t_ns)
    return image, private_boxes(image, world.things) + road_boxes(image, world.road)


def test_a_box_is_the_frame_around_the_pixels_in_sight(world: World, tracer: Tracer) -> None:
    image, found = boxes(world, tracer, moments(world)[1])
    assert {box.kind for box in found} == {"positive", "negative", "face", "plate"}
    for box in found:
        rows, columns = np.nonzero(image == box.thing)
        assert (box.x_min, box.x_max) == (columns.min() - 0.5, columns.max() + 0.5)
        assert (box.y_min, box.y_max) == (rows.min() - 0.5, rows.max() + 0.5)
        assert box.visible == len(rows)
        assert world.things[box.thing].kind == {"positive": "bump", "negative": "pothole"}.get(
            box.kind, box.kind
        )


def test_the_share_in_sight_is_that_of_rays_at_the_thing_alone(world: World, tracer: Tracer) -> None:
    hidden = 0
    for t_ns in moments(world):
        _, found = boxes(world, tracer, t_ns)
        for _, _, box in with_shares(world, [(CAMERA, t_ns, box) for box in found]):
            if box.visible < 40:
                continue
            wanted = box.visible / alone(world, box.thing, t_ns)
            # Few pixels count roughly.
            assert box.share == pytest.approx(wanted, abs=0.12), box
            hidden += wanted < 0.9
    assert hidden


def test_what_half_is_hidden_of_a_plate_is_half(world: World, tracer: Tracer) -> None:
    t_ns = moments(world)[2]
    silhouettes = Silhouettes(world)
    box = max((b for b in boxes(world, tracer, t_ns)[1] if b.kind == "plate"), key=lambda b: b.visible)
    whole = alone(world, box.thing, t_ns)
    assert whole > 60
    for share in (1.0, 0.5, 0.1):
        covered = replace(box, visible=round(share * whole))
        assert silhouettes.share(covered, CAMERA, t_ns) == pytest.approx(share, abs=0.08)
