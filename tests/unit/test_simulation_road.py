"""The road's surface: spectrum, irregularities, mesh, and what a tyre stands on."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from card.geometry import Trajectory
from card.simulation.centreline import CentreLine, circuit, winding
from card.simulation.drives import DRIVES, FURTHER_DRIVES, RURAL, TOWN, TRACK
from card.simulation.footprint import FOOTPRINT_M, footprint_height, wheel_contacts
from card.simulation.irregularities import PROFILES, Bump, Irregularity, Manhole, Patch, Pothole
from card.simulation.road import BANK_CURVATURE, CROWN_SLOPE, CrossSection, Hills, Road
from card.simulation.road_mesh import road_mesh
from card.simulation.road_plan import plan
from card.simulation.spectrum import CLASSES, Roughness, roughness

Array = NDArray[np.float64]
SMOOTH = Roughness(*np.zeros((4, 0)))
FLAT = Hills(np.zeros(0), np.zeros((0, 2)), np.zeros(0))


#: Limits of the displacement spectral density at 0.1 cycles/m, m^3: ISO 8608:2016, table C.1.
ISO_8608_LIMITS = {
    "A": (0.0, 32e-6),
    "B": (32e-6, 128e-6),
    "C": (128e-6, 512e-6),
    "D": (512e-6, 2048e-6),
    "E": (2048e-6, 8192e-6),
}


def tallest(thing: Irregularity) -> float:
    return -thing.depth if isinstance(thing, Pothole) else thing.rise


def straight_road(*things: Irregularity, section=RURAL, rough: Roughness = SMOOTH) -> Road:  # type: ignore[no-untyped-def]
    return Road(CentreLine(np.zeros(120)), section, FLAT, rough, things, np.eye(4))


@pytest.mark.parametrize("road_class", sorted(CLASSES))
def test_roughness_has_the_level_and_the_slope_of_its_iso_8608_class(road_class: str) -> None:
    length, step = 2000.0, 0.1
    s = np.arange(0, length, step)
    n = np.fft.rfftfreq(len(s), step)
    z = np.stack(
        [
            roughness(road_class, np.random.default_rng(seed), period=length).height(s, np.full_like(s, 0.8))
            for seed in range(4)
        ]
    )
    density = np.mean(2 * np.abs(np.fft.rfft(z) / len(s)) ** 2 * length, axis=0)  # one-sided, m^3
    # Eight bands of about half an octave hold several waves each; ISO 8608 smooths over octaves.
    edges = np.geomspace(0.026, 1.95, 9)
    middle, level = np.sqrt(edges[1:] * edges[:-1]), []
    for low, high in pairwise(edges):
        level.append(density[(n >= low) & (n < high)].sum() / length / (high - low))
    slope, at_reference = np.polyfit(np.log10(middle / 0.1), np.log10(level), 1)
    assert slope == pytest.approx(-2.0, abs=0.1)
    lowest, highest = ISO_8608_LIMITS[road_class]
    assert lowest < 10**at_reference < highest
    assert 10**at_reference == pytest.approx(CLASSES[road_class], rel=0.2)
    assert density[n > 2.1].max() < 1e-12


def test_the_drives_know_roads_of_all_classes() -> None:
    drives = (DRIVES | FURTHER_DRIVES).values()
    assert {drive.road_class for drive in drives} == set(CLASSES)


@pytest.mark.parametrize("section", [TOWN, RURAL, TRACK])
def test_crown_and_bank_slope(section: CrossSection) -> None:
    section = replace(section, ruts=0.0)
    radius = 40.0
    for turn in (1.0, 0.0, -1.0):
        line = CentreLine(np.full(400, turn / radius))
        road = Road(line, section, FLAT, SMOOTH, (), np.eye(4))
        s = np.full(2, 100.0)
        q = np.tanh(turn / radius / BANK_CURVATURE)
        for side in (-1.0, 1.0):
            height = road.xyz(s, side * np.array([1.0, 2.0]))[:, 2]
            wanted = side * q * section.bank - CROWN_SLOPE * (1 - q * q)
            assert height[1] - height[0] == pytest.approx(wanted, abs=1e-3)
    # A bend to the left lifts the right edge; nearly all of the crown is gone.
    assert section.height(np.array([2.0]), 1 / radius)[0] > 0.9 * 2.0 * section.bank - 0.01


def test_curvature_is_the_turn_of_the_tangent() -> None:
    for line in (winding(300.0, -20.0, 0.015, np.random.default_rng(1)), circuit(60.0, 20.0)):
        s = np.arange(5.0, 200.0, 0.25)
        tangent = line.at(s, 1)
        heading = np.unwrap(np.arctan2(-tangent[:, 0], tangent[:, 1]))
        assert np.abs(np.gradient(heading, s) - line.curvature(s))[2:-2].max() < 2e-3


def test_circuit_closes_smoothly() -> None:
    line = circuit(60.0, 14.0)
    for derivative in (0, 1, 2):
        np.testing.assert_allclose(
            line.at(-0.001, derivative), line.at(line.length - 0.001, derivative), atol=1e-9
        )
    ends = line.at(np.array([0.0, line.length - 1e-6]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)
    s = np.linspace(0, line.length, 500)
    np.testing.assert_allclose(np.linalg.norm(line.at(s, 1), axis=1), 1.0, atol=0.02)


def test_projection_undoes_offset() -> None:
    line = winding(200.0, -20.0, 0.015, np.random.default_rng(3))
    s, d = np.random.default_rng(4).uniform(-10, 170, 50), np.random.default_rng(5).uniform(-4, 4, 50)
    back_s, back_d = line.project(line.offset(s, d), s + 1.0)
    np.testing.assert_allclose(back_s, s, atol=1e-6)
    np.testing.assert_allclose(back_d, d, atol=1e-6)
    assert line.offset(np.array(0.0), np.array(1.0))[0] == pytest.approx(1.0)  # d runs to the right


THINGS: list[Irregularity] = [
    Bump(30.0, -2.5, 2.5, 1.2, 0.06),
    Bump(30.0, -2.5, 2.5, 1.2, 0.06, "sinusoidal"),
    Bump(30.0, -2.5, 2.5, 4.0, 0.09, "flat"),
    Bump(30.0, 0.2, 1.9, 2.5, 0.065, "cushion"),
    Pothole(30.02, 1.03, 0.45, 0.31, 0.07, np.array([[0.04, 1.0], [0.05, 2.0], [0.03, 0.5]])),
    Manhole(30.04, 0.71, -0.018),
    Patch(30.0, 0.33, 1.22, 0.61, 0.009),
]


@pytest.mark.parametrize("thing", THINGS, ids=lambda t: getattr(t, "profile", t.kind))
def test_mesh_follows_the_height_function(thing: Irregularity) -> None:
    road = straight_road(thing, rough=roughness("C", np.random.default_rng(1)))
    mesh = road_mesh(road, (10, 50), (5, 55))
    corners = mesh.vertices[mesh.triangles[mesh.thing == 0]]
    middle = corners.mean(axis=1)
    true = road.height(middle[:, :2], middle[:, 1])
    assert np.abs(middle[:, 2] - true).max() < 0.001
    raised = road.raised(middle[:, 1], middle[:, 0])
    assert np.abs(raised).max() == pytest.approx(np.abs(tallest(thing)), rel=0.03)


@pytest.mark.parametrize("thing", THINGS, ids=lambda t: getattr(t, "profile", t.kind))
def test_what_is_fitted_in_leaves_no_gap_and_no_overlap(thing: Irregularity) -> None:
    road = straight_road(thing)
    mesh = road_mesh(road, (10, 50), (5, 55))
    corners = mesh.vertices[mesh.triangles][..., :2]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert area == pytest.approx(50 * 2 * (road.section.reach + 3.0), rel=1e-9)


@pytest.mark.parametrize("profile", PROFILES)
def test_profile_of_a_bump(profile: str) -> None:
    length, rise = 3.0, 0.08
    bump = Bump(30.0, -3.0, 3.0, length, rise, profile)
    x = np.linspace(-0.5, 0.5, 11) * length
    share = np.abs(x) / (length / 2)
    wanted = {
        # Watts: an arc of a circle through both feet and the top.
        "round": np.sqrt((radius := (length**2 / 4 + rise**2) / (2 * rise)) ** 2 - x**2) - radius + rise,
        "sinusoidal": rise / 2 * (1 + np.cos(np.pi * share)),
        "flat": rise * np.minimum(1, 2 - 2 * share),
        "cushion": rise * np.minimum(1, (1 - share) * length / 2 / 0.4),
    }[profile]
    np.testing.assert_allclose(bump.height(30.0 + x, np.zeros(11)), wanted, atol=1e-4)
    assert bump.height(np.array([30.0]), np.array([3.0]))[0] == 0.0


def test_a_pothole_is_as_deep_as_it_says_and_its_walls_are_steep() -> None:
    rim = np.array([[0.05, 1.0], [0.05, 2.0], [0.05, 0.5]])
    hole = Pothole(10.0, 1.0, 0.6, 0.35, 0.07, rim)
    s, d = np.meshgrid(np.linspace(9, 11, 801), np.linspace(0, 2, 801), indexing="ij")
    height = hole.height(s, d)
    assert height.min() == pytest.approx(-0.07)
    assert np.count_nonzero(height < -0.069) > 0.7 * np.count_nonzero(height < 0)  # a floor, not a bowl
    slope = np.degrees(np.arctan(np.hypot(*np.gradient(height, 2 / 800)).max()))
    assert slope > 55


@pytest.mark.parametrize("profile", PROFILES)
def test_wheel_stands_on_the_mean_over_its_footprint(profile: str) -> None:
    rise, length = 0.06, 1.4
    bump = Bump(30.0, -2.8, 2.8, length, rise, profile)
    road = straight_road(bump)
    y = np.linspace(29.0, 31.0, 81)
    xy = np.column_stack([np.full_like(y, 0.9), y])
    forward = np.tile([0.0, 1.0], (len(y), 1))
    crown = footprint_height(straight_road(), xy, forward, y)
    found = footprint_height(road, xy, forward, y) - crown
    fine = FOOTPRINT_M[0] * ((np.arange(4000) + 0.5) / 4000 - 0.5)
    along = y[:, None] + fine
    wanted = np.where(np.abs(along - 30) < length / 2, bump.height(along, 0 * along), 0.0).mean(axis=1)
    np.testing.assert_allclose(found, wanted, atol=5e-5)
    if profile == "sinusoidal":  # its mean in closed form, inside the feet
        inside = np.abs(y - 30) < length / 2 - FOOTPRINT_M[0] / 2
        k = 2 * np.pi / length
        damped = np.sinc(k * FOOTPRINT_M[0] / 2 / np.pi) * np.cos(k * (y[inside] - 30))
        np.testing.assert_allclose(found[inside], rise / 2 * (1 + damped), atol=5e-5)
        assert found.max() < rise  # the mean, not the top


def test_wheel_on_waves_sees_each_damped_by_its_sinc() -> None:
    rough = roughness("D", np.random.default_rng(3))
    road = straight_road(section=replace(RURAL, bank=0.0), rough=rough)
    y = np.linspace(10, 40, 200)
    xy = np.column_stack([np.full_like(y, 0.8), y])
    forward = np.tile([0.0, 1.0], (len(y), 1))
    found = footprint_height(road, xy, forward, y) - footprint_height(straight_road(), xy, forward, y)
    along, across = (
        k[:, None] * size / 2 / np.pi
        for k, size in zip((rough.along, rough.across), FOOTPRINT_M, strict=True)
    )
    waves = np.cos(rough.along[:, None] * y + rough.across[:, None] * 0.8 + rough.phase[:, None])
    wanted = (rough.amplitude[:, None] * np.sinc(along) * np.sinc(across) * waves).sum(axis=0)
    np.testing.assert_allclose(found, wanted, atol=5e-6)


def test_wheel_on_a_manhole_and_at_the_edge_of_a_patch() -> None:
    forward = np.array([[0.0, 1.0]])
    bare = straight_road()
    for thing, y, wanted in (
        (Manhole(30.0, 0.9, -0.018), 30.0, -0.018),
        (Patch(30.0, 0.9, 1.0, 0.8, 0.010), 29.0 + 0.015, 0.005),
        (Pothole(30.0, 0.9, 0.6, 0.5, 0.06), 30.0, -0.06),
    ):
        xy, guess = np.array([[0.9, y]]), np.array([y])
        found = footprint_height(straight_road(thing), xy, forward, guess) - footprint_height(
            bare, xy, forward, guess
        )
        assert found[0] == pytest.approx(wanted, abs=1e-5)


def test_the_plan_puts_nothing_on_top_of_another() -> None:
    kinds: set[str] = set()
    for name, drive in (DRIVES | FURTHER_DRIVES).items():
        rng = np.random.default_rng(len(name))
        line = winding(400.0, -60.0, 0.01, rng)
        things = plan(drive, line, 30.0, rng)
        kinds |= {getattr(thing, "profile", thing.kind) for thing in things}
        for i, one in enumerate(things):
            assert max(abs(one.extent[2]), abs(one.extent[3])) < drive.section.half_width
            for other in things[:i]:
                a, b = one.extent, other.extent
                assert a[0] > b[1] or a[1] < b[0] or a[2] > b[3] or a[3] < b[2]
    assert kinds == {*PROFILES, "pothole", "manhole", "patch"}


def test_wheel_contact_slides_along_the_rigs_z() -> None:
    road = straight_road(section=TOWN)
    roll = np.radians(3.0)
    t_ns = np.array([0, 10])
    pose = Trajectory(
        t_ns, np.tile([0.0, 20.0, 1.7], (2, 1)), np.tile([np.cos(roll / 2), 0, np.sin(roll / 2), 0], (2, 1))
    )
    contact = wheel_contacts(road, pose, np.array([0.84, 0.75, -1.70]), np.full(2, 20.0))[0]
    up = pose.at(0)[:3, 2]
    rest = pose.at(0)[:3, :3] @ [0.84, 0.75, -1.70] + [0, 20, 1.7]
    assert np.linalg.norm(np.cross(contact - rest, up)) < 1e-9
    below = footprint_height(road, contact[None, :2], np.array([[0.0, 1.0]]), np.array([20.75]))
    assert contact[2] == pytest.approx(below[0], abs=1e-5)
