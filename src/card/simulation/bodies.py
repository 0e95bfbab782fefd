"""Cars and walkers, each in a frame of its own: origin on the ground below its middle, y ahead, z up."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from card.geometry import transform
from card.simulation.faces_and_plates import FACE_SIZE_M, PLATE_SIZE_M
from card.simulation.mesh import Mesh, box, cylinder, ellipsoid, grid, join, mesh, picture
from card.simulation.surfaces import Surface

Array = NDArray[np.float64]

CAR_LENGTH_M, CAR_WIDTH_M, CAR_WHEELBASE_M, CAR_TRACK_M = 4.4, 1.8, 2.7, 1.76
#: Offset to the side and height of the joints of a walker 1.75 m tall.
HIP_M, SHOULDER_M = (0.10, 0.92), (0.22, 1.42)
EYE_HEIGHT_M = 1.60
#: (2, 3): where a car's headlights are in its own frame, and ours in ``rig``; they shine along y.
HEADLIGHTS_M = np.array([[-0.66, 2.22, 0.73], [0.66, 2.22, 0.73]])
EGO_HEADLIGHTS_M = np.array([[-0.7, 1.67, -1.0], [0.7, 1.67, -1.0]])
_PLATE_GAP_M = 0.015
#: Where a face's outline is along the head, and by how much its middle stands out from there.
_FACE_BACK_M, _FACE_DEPTH_M = -0.005, 0.125

#: Side view of a car: (y, z) of the body's outline and of the cabin on top of it.
_CAR_BODY = [(-2.2, 0.32), (-2.2, 0.85), (-1.9, 0.98), (1.0, 0.95), (2.0, 0.78), (2.2, 0.62), (2.2, 0.32)]
_CAR_CABIN = [(-1.95, 0.96), (-1.45, 1.42), (0.05, 1.45), (1.0, 0.94)]


def car(colour: ArrayLike, plates: tuple[int, int], *, lit: bool = True) -> Mesh:
    """A car 4.4 m long whose front and rear plates are the things ``plates``, its lamps on or off."""
    lamps = Surface.LAMP if lit else Surface.CAR_BODY
    half = CAR_WIDTH_M / 2
    parts = [
        _extruded(_CAR_BODY, half, half, Surface.CAR_BODY, colour),
        _extruded(_CAR_CABIN, half - 0.08, half - 0.28, Surface.CAR_GLASS),
        box((-half + 0.28, -1.40, 1.425), (half - 0.28, 0.02, 1.47), Surface.CAR_BODY, colour),
        _plate(np.array([0.0, CAR_LENGTH_M / 2 + _PLATE_GAP_M, 0.50]), 1.0, plates[0]),
        _plate(np.array([0.0, -CAR_LENGTH_M / 2 - _PLATE_GAP_M, 0.70]), -1.0, plates[1]),
    ]
    for side in (-CAR_TRACK_M / 2, CAR_TRACK_M / 2):
        for y in (-CAR_WHEELBASE_M / 2, CAR_WHEELBASE_M / 2):
            parts.append(cylinder((side - 0.1, y, 0.33), (side + 0.1, y, 0.33), (0.33, 0.33), Surface.TYRE))
        for y, colour_lamp in ((-2.205, (1.0, 0.05, 0.05)), (2.205, (1.0, 1.0, 0.9))):
            x = 0.75 * side
            parts.append(box((x - 0.14, y - 0.01, 0.66), (x + 0.14, y + 0.01, 0.80), lamps, colour_lamp))
    return join(parts)


def ego_body() -> Mesh:
    """Our own car in ``rig``: hood, windscreen, roof and flanks."""
    outline = [
        (-2.95, -1.35), (-2.95, -0.75), (-2.35, -0.10), (-0.15, -0.10), (0.70, -0.66), (1.45, -0.80),
        (1.62, -0.98), (1.66, -1.35),
    ]  # fmt: skip
    low = [(y, min(z, -0.66)) for y, z in outline]
    return join(
        [
            _extruded(low, 0.94, 0.94, Surface.CAR_BODY, (0.10, 0.11, 0.13)),
            _extruded(outline[1:5], 0.88, 0.62, Surface.CAR_BODY, (0.10, 0.11, 0.13)),
        ]
    )


def walker(colours: Array, face: int, head_turn: float, height: float) -> Mesh:
    """Trunk and head of a walker ``height`` m tall with face ``face``, looking ``head_turn`` rad left.

    colours : (2, 3) albedo of shirt and trousers. Limbs are bodies of their own, see `leg` and `arm`.
    """
    k = height / 1.75
    head = join(
        [
            ellipsoid((0, -0.02, 0), (0.112, 0.12, 0.137), Surface.SKIN, (0.35, 0.3, 0.28)),
            _face_patch(face),
        ]
    )
    c, s = np.cos(head_turn / 2), np.sin(head_turn / 2)
    parts = [
        ellipsoid((0, 0, 1.17), (0.20, 0.13, 0.34), Surface.CLOTH, colours[0]),
        ellipsoid((0, 0, 0.93), (0.17, 0.12, 0.14), Surface.CLOTH, colours[1]),
        cylinder((-0.19, 0, 1.42), (0.19, 0, 1.42), (0.065, 0.065), Surface.CLOTH, colours[0]),
        cylinder((0, 0, 1.42), (0, 0, 1.53), (0.06, 0.06), Surface.SKIN),
        head.moved(transform((0, 0, EYE_HEIGHT_M), (c, 0, 0, s))),
    ]
    return join(parts).moved(np.diag([k, k, k, 1.0]))


def arm(colour: ArrayLike, height: float, side: float) -> Mesh:
    """One arm, origin at the shoulder, hanging down; on the right for ``side`` 1, left for -1."""
    k = height / 1.75
    elbow, wrist = (0.03 * side, -0.01, -0.29), (0.04 * side, 0.06, -0.54)
    parts = [
        cylinder((0, 0, 0.03), elbow, (0.06, 0.05), Surface.CLOTH, colour),
        cylinder(elbow, wrist, (0.05, 0.04), Surface.CLOTH, colour),
        ellipsoid((0.04 * side, 0.08, -0.60), (0.03, 0.045, 0.08), Surface.SKIN),
    ]
    return join(parts).moved(np.diag([k, k, k, 1.0]))


def leg(colour: ArrayLike, height: float) -> Mesh:
    """One leg, origin at the hip, hanging down."""
    k = height / 1.75
    parts = [
        cylinder((0, 0, 0.05), (0, 0, -0.88), (0.09, 0.055), Surface.CLOTH, colour),
        box((-0.05, -0.07, -0.92), (0.05, 0.18, -0.85), Surface.TYRE),
    ]
    return join(parts).moved(np.diag([k, k, k, 1.0]))


def _extruded(
    outline: list[tuple[float, float]],
    half_low: float,
    half_high: float,
    surface: Surface,
    tint: ArrayLike = (1.0, 1.0, 1.0),
) -> Mesh:
    """A side view (y, z) made solid; its half width goes from ``half_low`` at the bottom to ``half_high``."""
    yz = np.array(outline)
    share = (yz[:, 1] - yz[:, 1].min()) / np.ptp(yz[:, 1])
    half = half_low + share * (half_high - half_low)
    left, right = np.column_stack([-half, yz]), np.column_stack([half, yz])
    count = len(yz)
    ring = np.arange(count)
    after = np.roll(ring, -1)
    skin = np.concatenate(
        [np.stack([ring, after, ring + count], 1), np.stack([after, after + count, ring + count], 1)]
    )
    caps = np.array([[0, i, i + 1] for i in range(1, count - 1)])
    return mesh(np.concatenate([left, right]), np.concatenate([skin, caps, caps + count]), surface, tint)


def _plate(centre: Array, facing: float, thing: int) -> Mesh:
    """A plate that looks along +y (facing 1) or -y (facing -1); its text reads from outside."""
    height, width = PLATE_SIZE_M
    right = np.array([-facing, 0.0, 0.0])
    up = np.array([0.0, 0.0, 1.0])
    corners = [
        centre + x * width / 2 * right + z * height / 2 * up for x, z in ((-1, 1), (1, 1), (1, -1), (-1, -1))
    ]
    return picture(corners, Surface.PLATE, thing)


def _face_patch(thing: int) -> Mesh:
    """The oval of a face's picture, laid around the front of the head, seen from +y."""
    height, width = FACE_SIZE_M
    u, v = np.meshgrid(np.linspace(-1, 1, 11), np.linspace(-1, 1, 11))
    # A square pressed into a disc.
    across, down = u * np.sqrt(1 - v**2 / 2), v * np.sqrt(1 - u**2 / 2)
    x, z = -0.97 * across * width / 2, -0.97 * down * height / 2
    y = _FACE_BACK_M + _FACE_DEPTH_M * np.sqrt(np.maximum(1 - across**2 - down**2, 0))
    uv = np.stack([(1 + across) / 2, (1 + down) / 2], axis=-1)
    patch = grid(np.stack([x, y, z], axis=-1), Surface.FACE, uv=uv)
    patch.thing[:] = thing
    return patch
