"""The three pictures of a drive's preview."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from card.geometry import apply
from card.recording.paths import image_path
from card.simulation.photographs import Photographer
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CAMERAS
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.world import World

Array = NDArray[np.float64]

_MARGIN_M = 15.0
_GRID = 1400
_NEAR_M = 35.0
_BOX_COLOURS = {"positive": "orange", "negative": "red", "face": "cyan", "plate": "lime"}


def top_view(world: World, tracer: Tracer, now: int, path: Path) -> None:
    """The drive from above, y up: the whole way, and the car's surroundings at ``now`` (ns)."""
    during = (world.course.t >= 0) & (world.course.t <= world.scale.duration_s)
    way = world.path.translation_m[during]
    here = world.path.at(now)[:2, 3]
    figure = Figure(figsize=(16, 8), layout="constrained")
    whole, near = figure.subplots(1, 2)
    low, high = way[:, :2].min(axis=0) - _MARGIN_M, way[:, :2].max(axis=0) + _MARGIN_M
    centre, half = (low + high) / 2, max(high - low) / 2
    _from_above(world, tracer, centre - half, centre + half, whole)
    whole.plot(way[:, 0], way[:, 1], "w-", linewidth=0.8)
    whole.plot(*here, "ro", markersize=4)
    _from_above(world, tracer, here - _NEAR_M, here + _NEAR_M, near)
    near.plot(way[:, 0], way[:, 1], "w-", linewidth=0.8)
    for indices, colour in ((world.cars, "deepskyblue"), (world.walkers, "magenta")):
        for mover in (world.movers[index] for index in indices):
            track, spot = mover.path.translation_m, apply(mover.path.at(now), mover.mesh.vertices)
            for axes in (whole, near):
                axes.plot(track[:, 0], track[:, 1], "-", color=colour, linewidth=0.4)
                axes.plot(spot[:, 0], spot[:, 1], ".", color=colour, markersize=0.6)
    for thing in world.road.irregularities:
        spot = world.road.xyz([thing.s], [(thing.extent[2] + thing.extent[3]) / 2])[0]
        if np.abs(spot[:2] - here).max() < _NEAR_M:
            near.annotate(type(thing).__name__.lower(), spot[:2], color="yellow", fontsize=7)
    near.set(xlim=here[0] + np.array([-1, 1]) * _NEAR_M, ylim=here[1] + np.array([-1, 1]) * _NEAR_M)
    whole.set(
        xlim=(centre - half)[0] + np.array([0, 2]) * half, ylim=(centre - half)[1] + np.array([0, 2]) * half
    )
    whole.set_title(f"{world.name}: the whole way")
    near.set_title(f"at {(now - world.start_ns) * 1e-9:g} s")
    figure.savefig(path, dpi=100)


def sweep(world: World, clouds: dict[str, tuple[Array, NDArray[np.uint8]]], now: int, path: Path) -> None:
    """One sweep of each LiDAR at ``now`` (ns), coloured by surface: from above, and as seen from the car."""
    pose = world.path.at(now)
    figure = Figure(figsize=(16, 14), layout="constrained")
    axes = figure.subplots(2, 2)
    for column, (name, (points, surface)) in enumerate(clouds.items()):
        rig = apply(np.linalg.inv(pose), points)
        colours = _COLOURS[surface]
        above, ahead = axes[0, column], axes[1, column]
        above.scatter(rig[:, 0], rig[:, 1], c=colours, s=1.5, linewidths=0)
        above.set(
            xlim=(-30, 30), ylim=(-30, 30), aspect="equal", facecolor="black", title=f"{name}, from above"
        )
        sign = -1 if "rear" in name else 1
        front = sign * rig[:, 1] > 1
        u, v = rig[front, 0] / rig[front, 1], rig[front, 2] / np.abs(rig[front, 1])
        ahead.scatter(u, v, c=colours[front], s=2.0, linewidths=0)
        ahead.set(xlim=(-1.2, 1.2), ylim=(-0.6, 0.6), facecolor="black", title=f"{name}, from the car")
    figure.savefig(path, dpi=100)


def stereo_pair(world: World, tracer: Tracer, ego: Scene, number: int, path: Path) -> None:
    """Images ``number`` of both cameras with the boxes that are true in them."""
    photographer = Photographer(world, tracer, ego)
    models = [world.rig.cameras[name] for name in CAMERAS]
    figure = Figure(figsize=(sum(m.width for m in models) / 100, models[0].height / 100))
    for index, name in enumerate(CAMERAS):
        with TemporaryDirectory() as scratch:
            folder = Path(scratch)
            image_path(folder, name, 0).parent.mkdir()
            found = photographer.photograph(name, range(number, number + 1), folder)
            image = np.asarray(Image.open(next((folder / name).iterdir())))
        axes = figure.add_axes((index / 2, 0, 0.5, 1))
        axes.imshow(image, interpolation="nearest", aspect="auto")
        axes.axis("off")
        for _, _, box in found:
            x, y = [box.x_min, box.x_max], [box.y_min, box.y_max]
            axes.plot(
                [x[0], x[1], x[1], x[0], x[0]],
                [y[0], y[0], y[1], y[1], y[0]],
                color=_BOX_COLOURS[box.kind],
                linewidth=0.6,
            )
    figure.savefig(path, dpi=100)


_COLOURS = np.clip([LOOKS[s].albedo for s in Surface], 0.02, 1.0) ** (1 / 2.2)


def _from_above(world: World, tracer: Tracer, low: Array, high: Array, axes: Axes) -> None:
    """The standing world looked down at between two corners, shaded by its slopes."""
    x, y = np.linspace(low[0], high[0], _GRID), np.linspace(high[1], low[1], _GRID)
    down = np.stack([*np.meshgrid(x, y), np.full((_GRID, _GRID), 100.0)], axis=-1).reshape(-1, 3)
    hits = tracer.static.cast(down, np.array([0.0, 0.0, -1.0]))
    rgb = np.zeros((len(down), 3))
    met = hits.triangle >= 0
    triangle = hits.triangle[met]
    light = np.abs(hits.normal[met] @ np.array([-0.5, 0.3, 0.81]))
    rgb[met] = _COLOURS[world.static.surface[triangle]] * world.static.tint[triangle] * light[:, None]
    picture = np.clip(rgb * 1.4, 0, 1).reshape(_GRID, _GRID, 3)
    axes.imshow(picture, extent=(low[0], high[0], low[1], high[1]), interpolation="nearest")
