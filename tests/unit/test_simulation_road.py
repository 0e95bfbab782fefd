"""The road's surface: spectrum, irregularities, mesh, and what a tyre stands on."""

import numpy as np
import pytest
from numpy.typing import NDArray

from card.geometry import Trajectory
from card.simulation.centreline import CentreLine, circuit, winding
from card.simulation.drives import RURAL, TOWN
from card.simulation.footprint import FOOTPRINT_M, footprint_height, wheel_contacts
from card.simulation.irregularities import Bump, Irregularity, Pothole
from card.simulation.road import Hills, Road
from card.simulation.road_mesh import road_mesh
from card.simulation.spectrum import CLASSES, Roughness, roughness

Array = NDArray[np.float64]
SMOOTH = Roughness(*np.zeros((4, 0)))
FLAT = Hills(np.zeros(0), np.zeros((0, 2)), np.zeros(0))


def straight_road(*things: Irregularity, section=RURAL, rough: Roughness = SMOOTH) -> Road:  # type: ignore[no-untyped-def]
    return Road(CentreLine(np.zeros(120)), section, FLAT, rough, things, np.eye(4))


def test_roughness_has_the_spectrum_of_its_class() -> None:
    length, step = 2000.0, 0.1
    s = np.arange(0, length, step)
    found = []
    for seed in range(6):
        z = roughness("C", np.random.default_rng(seed), period=length).height(s, np.full_like(s, 0.8))
        power = 2 * np.abs(np.fft.rfft(z) / len(z)) ** 2 * length  # one-sided density, m^3
        found.append(power)
    n = np.fft.rfftfreq(len(s), step)
    density = np.mean(found, axis=0)
    for low, high in ((0.05, 0.15), (0.3, 0.8), (0.8, 1.8)):
        band = (n > low) & (n < high)
        wanted = np.sum(CLASSES["C"] * (n[band] / 0.1) ** -2)
        assert np.sum(density[band]) == pytest.approx(wanted, rel=0.35)
    assert density[n > 2.1].max() < 1e-12


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


@pytest.mark.parametrize(
    "thing",
    [
        Bump(30.0, -2.5, 2.5, 1.2, 0.06),
        Bump(30.0, -2.5, 2.5, 4.0, 0.09, "flat"),
        Pothole(30.02, 1.03, 0.45, 0.31, 0.07),
    ],
)
def test_mesh_follows_the_height_function(thing: Irregularity) -> None:
    road = straight_road(thing, rough=roughness("C", np.random.default_rng(1)))
    mesh = road_mesh(road, (10, 50), (5, 55))
    corners = mesh.vertices[mesh.triangles[mesh.thing == 0]]
    middle = corners.mean(axis=1)
    true = road.height(middle[:, :2], middle[:, 1])
    assert np.abs(middle[:, 2] - true).max() < 0.001
    assert np.ptp(true) > 0.03


def test_pothole_patch_leaves_no_gap_and_no_overlap() -> None:
    road = straight_road(Pothole(30.02, 1.03, 0.45, 0.31, 0.07))
    mesh = road_mesh(road, (10, 50), (5, 55))
    corners = mesh.vertices[mesh.triangles][..., :2]
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() / 2
    assert area == pytest.approx(50 * 2 * (road.section.reach + 3.0), rel=1e-9)


def test_wheel_stands_on_the_mean_over_its_footprint() -> None:
    rise, length = 0.06, 1.0
    road = straight_road(Bump(30.0, -2.8, 2.8, length, rise))
    y = np.linspace(29.2, 30.8, 33)
    xy = np.column_stack([np.full_like(y, 0.9), y])
    forward = np.tile([0.0, 1.0], (len(y), 1))
    crown = footprint_height(straight_road(), xy, forward, y)
    found = footprint_height(road, xy, forward, y) - crown
    fine = np.linspace(-FOOTPRINT_M[0] / 2, FOOTPRINT_M[0] / 2, 4001)
    x = np.abs(y[:, None] + fine - 30.0) / (length / 2)
    wanted = np.where(x < 1, rise / 2 * (1 + np.cos(np.pi * x)), 0.0).mean(axis=1)
    np.testing.assert_allclose(found, wanted, atol=3e-4)
    assert found.max() < rise  # the mean, not the top


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
