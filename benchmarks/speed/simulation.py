"""The simulator: all drives at `tiny`; LiDARs and a stereo pair at the size of a real drive."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cost import cpu_s

from card.recording.laz import write_burst
from card.recording.paths import burst_path
from card.simulation.bodies import ego_body
from card.simulation.camera import Camera
from card.simulation.drives import DRIVES
from card.simulation.lidar import Lidar, burst_starts
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CAMERAS, LIDARS
from card.simulation.shading import Shader
from card.simulation.simulate import simulate_drive
from card.simulation.world import World, build_world

DRIVE = "de_town_bumps"
SEED = 1
REVOLUTIONS, A_MINUTE = 10, 600


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `tiny_s`, `lidar_s_per_min` and `stereo_pair_s`, all in CPU-seconds."""

    def tiny() -> None:
        for drive in DRIVES:
            folder = scratch / drive
            simulate_drive(drive, recording=folder / "raw", truth=folder / "truth", scale="tiny", seed=SEED)

    world = build_world(DRIVE, "full", SEED)
    tracer, ego = Tracer(world.static, world.movers), Scene(ego_body())
    lidar = cpu_s(lambda: _revolutions(world, tracer, ego, scratch), repeats)
    shader = Shader(tracer, world.things, world.drive.section, world.sun)
    cameras = [Camera(world.rig.cameras[name], world.rig.rig_from[name], ego, world.sun) for name in CAMERAS]
    stereo = cpu_s(lambda: _stereo_pair(world, tracer, shader, cameras), repeats)
    return [
        _row("tiny_s", cpu_s(tiny, repeats), 30),
        _row("lidar_s_per_min", lidar * A_MINUTE / REVOLUTIONS, 90),
        _row("stereo_pair_s", stereo, 2),
    ]


def _revolutions(world: World, tracer: Tracer, ego: Scene, folder: Path) -> None:
    for name in LIDARS:
        (folder / name).mkdir(exist_ok=True)
        sensor = Lidar(world, tracer, ego, name)
        starts = burst_starts(name, world.start_ns, world.scale.duration_s)
        for number, t_ns in enumerate(starts[:REVOLUTIONS]):
            write_burst(burst_path(folder, name, t_ns), sensor.scan(t_ns, number)[0])


def _stereo_pair(world: World, tracer: Tracer, shader: Shader, cameras: Sequence[Camera]) -> None:
    t_ns = world.start_ns + round(world.scale.camera_start_s * 1e9)
    for camera in cameras:
        camera.shoot(tracer, shader, world.path.at(t_ns), t_ns, world.rng("noise of the benchmark"))


def _row(figure: str, value: float, aim: float) -> dict[str, Any]:
    return {
        "stage": "simulation",
        "figure": figure,
        "value": value,
        "unit": "CPU-s",
        "aim": aim,
        "better": "lower",
    }
