"""A camera against closed forms: blur, vignetting, noise, shadow, lamps; an instant against rays in time."""

import io
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from card.geometry import CameraModel, Trajectory, apply, inverse
from card.simulation.blur import blurred
from card.simulation.bodies import ego_body
from card.simulation.camera import Camera
from card.simulation.exposure import DAY, FULL_WELL_E, JPEG_QUALITY, NIGHT, READ_NOISE_E, Exposure, jpeg
from card.simulation.lens import VIGNETTING_POWER, lens_of
from card.simulation.lighting import STREET_LAMP_CD, Daylight, Lamp, NightLight
from card.simulation.mesh import Mesh, box, join, mesh
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import nominal_rig
from card.simulation.shading import Shader
from card.simulation.snapshot import Snapshot
from card.simulation.surfaces import Surface
from card.simulation.world import World, build_world

Array = NDArray[np.float64]
_NOWHERE = Scene(box((90, 90, 90), (91, 91, 91), Surface.POLE))


def camera_of(world: World, ego: Scene = _NOWHERE, name: str = "camera_left") -> Camera:
    tracer = Tracer(world.static, world.movers)
    return Camera(world, tracer, Shader(tracer, world.things, world.drive.section), ego, name)


@pytest.fixture(scope="module")
def town() -> World:
    return build_world("de_town_bumps", "tiny", 5)


def at_night(world: World) -> World:
    return replace(world, drive=replace(world.drive, night=True))


def flying(world: World, velocity: Array, turning: Array, static: Mesh) -> World:
    """The same car without a road, moving through ``static`` at a constant rate."""
    seconds = (world.path.t_ns - world.start_ns) * 1e-9
    turns = Rotation.from_rotvec(seconds[:, None] * turning).as_quat(scalar_first=True)
    path = Trajectory(world.path.t_ns, seconds[:, None] * velocity, turns)
    return replace(world, path=path, static=static, movers=[], cars=(), rig=nominal_rig(200, 200))


def plane(z: float, surface: Surface = Surface.CAR_BODY) -> Mesh:
    corners = [[-400, -400, z], [400, -400, z], [400, 400, z], [-400, 400, z]]
    return mesh(corners, [[0, 1, 2], [0, 2, 3]], surface)


def wall(y: float) -> Mesh:
    return mesh(
        [[-99, y, -99], [99, y, -99], [99, y, 99], [-99, y, 99]], [[0, 1, 2], [0, 2, 3]], Surface.FACADE
    )


def test_a_picture_blurs_by_speed_times_exposure(town: World) -> None:
    speed, away = 14.0, 6.0
    world = flying(town, np.array([speed, 0, 0]), np.zeros(3), wall(away))
    camera = camera_of(world)
    model, t_ns = camera.lens.model, world.start_ns
    z = away - world.rig.rig_from["camera_left"][1, 3]
    middle = model.height // 2, model.width // 2
    moved = camera.view(t_ns).motion[middle]
    wanted = model.fx * speed * DAY.time_ns * 1e-9 / z
    assert moved[0] == pytest.approx(-wanted, rel=0.01)
    assert abs(moved[1]) < 0.05 * wanted


@pytest.mark.parametrize("turning", [np.zeros(3), np.array([0.3, -0.2, 0.5])])
def test_motion_is_what_a_moving_camera_projects(town: World, turning: Array) -> None:
    world = flying(
        replace(town, drive=replace(town.drive, night=True)), np.array([2, 9.0, 1]), turning, plane(-1.7)
    )
    camera = camera_of(world)
    pose, half = world.rig.rig_from["camera_left"], NIGHT.time_ns // 2
    times = world.start_ns + np.array([-half, 0, half])
    before, now, after = world.path.at(times) @ pose
    view = camera.view(times[1])
    on_road = np.isfinite(view.depth) & (view.depth < 30)
    v, u = np.nonzero(on_road)
    points = apply(now, camera.lens.model.rays(np.stack([u, v], axis=1)) * view.depth[on_road][:, None])
    moved = camera.lens.model.project(apply(inverse(after), points)) - camera.lens.model.project(
        apply(inverse(before), points)
    )
    # A point's way in the image is a little bent: by less than a hundredth of its length.
    np.testing.assert_allclose(view.motion[on_road], moved, atol=0.02 * np.abs(moved).max())
    assert np.abs(moved).max() > 2


def test_a_moving_car_blurs_and_a_standing_camera_does_not(town: World) -> None:
    camera = camera_of(replace(town, path=_standing(town, 3.0)))
    t_ns = town.start_ns + 3_000_000_000
    view = camera.view(t_ns)
    snapshot = Snapshot(Tracer(town.static, town.movers), _standing(town, 3.0).translation_m[0], t_ns)
    lens, pose = camera.lens, _standing(town, 3.0).at(t_ns) @ town.rig.rig_from["camera_left"]
    rays = np.concatenate([lens.rays, np.ones((*lens.length.shape, 1))], -1) @ pose[:3, :3].T
    sight = snapshot.look(pose[:3, 3], (rays / lens.length[..., None]).reshape(-1, 3).astype(np.float32))
    moving = (sight.triangle >= snapshot.static_triangles).reshape(lens.length.shape)
    assert 20 < moving.sum() < 0.5 * moving.size
    assert np.abs(view.motion[~moving]).max() < 1e-3
    assert np.median(np.linalg.norm(view.motion[moving], axis=1)) > 0.01


def _standing(world: World, seconds: float) -> Trajectory:
    pose = world.path.at(world.start_ns + round(seconds * 1e9))
    count = len(world.path.t_ns)
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(scalar_first=True)
    return Trajectory(world.path.t_ns, np.tile(pose[:3, 3], (count, 1)), np.tile(quaternion, (count, 1)))


def test_an_edge_becomes_a_ramp_as_long_as_the_motion() -> None:
    sharp = np.zeros((64, 200, 3), np.float32)
    sharp[:, 100:] = 1
    motion = np.zeros((64, 200, 2), np.float32)
    motion[..., 0] = 12.0
    ramp = blurred(sharp, motion, 64)[32, :, 0]
    x = np.arange(200)
    np.testing.assert_allclose(ramp, np.clip((x - 99.5 + 6) / 12, 0, 1), atol=0.06)
    assert np.array_equal(blurred(sharp, 0 * motion, 64), sharp)


def test_blur_is_the_mean_over_the_exposure(town: World) -> None:
    world = flying(town, np.array([40.0, 1, 0]), np.array([0, 0.4, -0.4]), wall(9.0))
    camera, t_ns = camera_of(world), world.start_ns + 100_000_000
    camera.exposure = NIGHT
    view = camera.view(t_ns)
    fast = blurred(view.light, view.motion, 64)
    shares = (np.arange(24) + 0.5) / 24 - 0.5
    reference = np.mean([camera.view(t_ns + round(s * NIGHT.time_ns)).light for s in shares], axis=0)
    inner = np.s_[8:-8, 8:-8]
    smeared, still = (np.abs(light - reference)[inner] for light in (fast, view.light))
    assert np.linalg.norm(view.motion, axis=-1).min() > 1
    assert smeared.mean() < 0.25 * still.mean()
    assert np.quantile(smeared, 0.99) < 0.06


def test_corners_are_dark_as_the_lens_says(town: World) -> None:
    lens = lens_of(town.rig.cameras["camera_left"])
    light = np.full((*lens.length.shape, 3), 0.5 * DAY.white, np.float32)
    shots = [DAY.taken(light, lens.vignetting, np.random.default_rng(k)) for k in range(60)]
    signal = np.mean([_signal(shot) for shot in shots], axis=(0, 3))
    v, u = np.mgrid[0 : lens.model.height, 0 : lens.model.width]
    rays = lens.model.rays(np.stack([u, v], axis=-1))
    cosine = 1 / np.linalg.norm(rays, axis=-1)
    np.testing.assert_allclose(signal, 0.5 * cosine**VIGNETTING_POWER, rtol=0.02)
    assert cosine.min() ** VIGNETTING_POWER < 0.6


def _signal(picture: NDArray[np.uint8]) -> Array:
    return np.asarray((picture / 255.0) ** 2.2)


@pytest.mark.parametrize("exposure", [DAY, NIGHT, Exposure(3_000_000, 16.0)])
def test_noise_grows_with_the_signal_as_electrons_do(exposure: Exposure) -> None:
    rng = np.random.default_rng(3)
    ones = np.ones((250, 250), np.float32)
    sensitivity = exposure.signal(ones[:1, :1])[0, 0]
    for signal in (0.1, 0.3, 0.6):
        light = np.full((250, 250, 3), signal / sensitivity, np.float32)
        picture = exposure.taken(light, ones, rng)
        electrons = FULL_WELL_E / exposure.gain
        variance = signal / electrons + (READ_NOISE_E / electrons) ** 2
        assert exposure.variance(np.float32(signal)) == pytest.approx(variance, rel=1e-5)
        slope = 255 * signal ** (1 / 2.2 - 1) / 2.2  # levels a unit of signal
        rounding = 1 / 12 / slope**2 + 1 / 12 / 4095**2
        assert _signal(picture).var() == pytest.approx(variance + rounding, rel=0.04)
        assert _signal(picture).mean() == pytest.approx(signal, rel=0.01)


def test_a_picture_is_compressed_at_the_camera_s_quality() -> None:
    ramp = np.tile(np.arange(64, dtype=np.uint8), (64, 1))[..., None].repeat(3, axis=-1)
    reference = io.BytesIO()
    Image.fromarray(ramp).save(reference, "JPEG", quality=JPEG_QUALITY, subsampling="4:2:0")
    found, wanted = Image.open(io.BytesIO(jpeg(ramp))), Image.open(reference)
    assert found.quantization == wanted.quantization
    assert found.layer == wanted.layer


def test_a_snapshot_meets_what_rays_at_its_time_meet(town: World) -> None:
    tracer, t_ns = Tracer(town.static, town.movers), town.start_ns + 2_500_000_000
    rng = np.random.default_rng(1)
    rays = rng.normal(0, 1, (20_000, 3)) * (1, 1, 0.2) + (0, 0.5, -0.05)
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
    origin = town.path.at(t_ns)[:3, 3]
    sight = Snapshot(tracer, origin, t_ns).look(origin, rays)
    origins = np.broadcast_to(origin, rays.shape)
    hits = tracer.cast(origins, rays.astype(float), np.full(len(rays), t_ns))
    same = sight.triangle == hits.triangle
    assert same.mean() > 0.999  # a ray along an edge may go either way
    met = same & (hits.triangle >= 0)
    np.testing.assert_allclose(sight.distance[met], hits.distance[met], rtol=1e-4, atol=2e-3)
    moving = met & (hits.triangle >= tracer.static_triangles)
    assert moving.sum() > 100
    np.testing.assert_allclose(np.abs(np.sum(sight.normal * hits.normal, axis=1))[moving], 1, atol=1e-3)


def test_a_wall_throws_a_shadow_as_long_as_the_sun_is_low() -> None:
    height, elevation = 3.0, np.radians(40)
    scene = join([plane(0.0), box((-50, 0, 0), (50, 0.2, height), Surface.FACADE)])
    sun = np.array([0, np.cos(elevation), np.sin(elevation)])
    snapshot = Snapshot(Tracer(scene, []), np.zeros(3), 0)
    y = np.linspace(-8, -0.1, 400)
    eye = np.array([0.0, -4.0, 30.0])
    rays = np.stack([0 * y + 0.5, y, 0 * y], axis=1) - eye
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
    sight = snapshot.look(eye, rays)
    light = np.ones((400, 3), np.float32)
    Daylight(sun).shine(light, np.zeros(400, np.uint8), sight, snapshot)
    bright = light[:, 0] > light[:, 0].mean()
    assert y[bright].max() == pytest.approx(-height / np.tan(elevation), abs=0.05)
    assert light[bright, 0].mean() - light[~bright, 0].mean() == pytest.approx(
        1.05 * np.sin(elevation), rel=1e-3
    )


def test_a_street_lamp_lights_by_the_square_of_its_distance() -> None:
    height = 5.6
    lamp = Lamp(np.array([0, 0, height]), np.eye(3), STREET_LAMP_CD, np.ones(3, np.float32), 35.0, False)
    snapshot = Snapshot(Tracer(plane(0.0), []), np.zeros(3), 0)
    x = np.linspace(-12, 12, 49)
    eye = np.array([0.0, 0.01, 20.0])
    rays = np.stack([x, 0 * x, 0 * x], axis=1) - eye
    rays = (rays / np.linalg.norm(rays, axis=1, keepdims=True)).astype(np.float32)
    sight = snapshot.look(eye, rays)
    with_lamp, without = np.ones((49, 3), np.float32), np.ones((49, 3), np.float32)
    none = np.zeros(49, np.uint8)
    NightLight(np.array([0, 0, 1.0]), [lamp]).shine(with_lamp, none, sight, snapshot)
    NightLight(np.array([0, 0, 1.0]), []).shine(without, none, sight, snapshot)
    squared = x**2 + height**2
    lux = STREET_LAMP_CD / squared * (height / np.sqrt(squared)) ** 2  # cosine of emission and of incidence
    np.testing.assert_allclose((with_lamp - without)[:, 0] * 1e5, lux, rtol=0.01, atol=0.05)


def test_night_pictures_are_darker_noisier_and_blur_longer(town: World) -> None:
    night = at_night(town)
    t_ns = town.start_ns + 3_000_000_000
    day_camera, night_camera = camera_of(town), camera_of(night)
    bright, dark = day_camera.view(t_ns), night_camera.view(t_ns)
    ratio = NIGHT.time_ns / DAY.time_ns
    np.testing.assert_allclose(
        dark.motion, ratio * bright.motion, atol=0.02 * ratio * np.abs(bright.motion).max()
    )
    shots = [camera.shoot(t_ns, np.random.default_rng(0)).rgb.mean() for camera in (day_camera, night_camera)]
    assert 5 < shots[1] < 0.6 * shots[0]


def test_own_hood_has_no_depth_no_thing_and_no_blur(town: World) -> None:
    camera = camera_of(town, Scene(ego_body()))
    view = camera.view(town.start_ns + 3_000_000_000)
    own = np.isnan(view.depth)
    assert 0.05 < own.mean() < 0.3
    assert own[-1].mean() > 0.8
    assert (view.thing[own] == -1).all()
    assert not view.motion[own].any()


def test_a_lens_s_rays_and_their_derivative_are_the_model_s() -> None:
    model = CameraModel(120, 90, 80.0, 82.0, 61.0, 44.0, (-0.1, 0.03, 4e-4, -3e-4, -0.004))
    lens = lens_of(model)
    v, u = np.mgrid[0:90, 0:120].astype(float)
    pixels = np.stack([u, v], axis=-1)
    np.testing.assert_allclose(lens.rays, model.rays(pixels)[..., :2], atol=1e-6)
    step = 1e-5
    for axis in range(2):
        offset = np.eye(2)[axis] * step
        there = model.distort(lens.rays + offset) - model.distort(lens.rays - offset.astype(float))
        wanted = there / (2 * step) * (model.fx, model.fy)
        np.testing.assert_allclose(lens.jacobian[..., [axis, 2 + axis]], wanted, rtol=1e-3, atol=1e-2)
