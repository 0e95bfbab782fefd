"""How a hit looks: albedo with texture and what light makes of it."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.simulation.compiled import compiled
from card.simulation.lighting import Light
from card.simulation.raycast import Tracer
from card.simulation.road import CrossSection
from card.simulation.snapshot import Sight, Snapshot
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.traffic import Thing

Image = NDArray[np.float32]

_ALBEDO = np.array([LOOKS[s].albedo for s in Surface], np.float32)
_FINE = np.array([LOOKS[s].fine for s in Surface], np.float32)
_COARSE = np.array([LOOKS[s].coarse for s in Surface], np.float32)
#: Width of a texel of the noise at each level, m, and what each surface has of it.
_TEXELS_M = np.array([0.018, 0.12, 0.9], np.float32)
_CONTRAST = np.stack([_FINE, np.float32(0.6) * _FINE, _COARSE])
_NOISE_SIZE = 512
#: Lane markings, bumps, joints, window frames and window panes.
_PAINTS = np.array(
    [[0.62, 0.62, 0.60], [0.62, 0.42, 0.05], [0.17] * 3, [0.75] * 3, [0.05, 0.06, 0.075]], np.float32
)
_ASPHALT, _BUMP, _SIDEWALK, _FACADE = (
    int(s) for s in (Surface.ASPHALT, Surface.BUMP, Surface.SIDEWALK, Surface.FACADE)
)


class Shader:
    """Colours of what is met in one world."""

    def __init__(self, tracer: Tracer, things: Sequence[Thing], section: CrossSection) -> None:
        mesh = tracer.all
        self._things, self._section = things, section
        self._surface, self._thing = mesh.surface, mesh.thing
        # Looked up a hit, so what belongs to a triangle lies together.
        self._corners = mesh.uv[mesh.triangles]
        self._tint = _ALBEDO[mesh.surface] * mesh.tint
        self._pictured = (mesh.surface == Surface.FACE) | (mesh.surface == Surface.PLATE)
        rng = np.random.default_rng(0)
        white = rng.normal(size=(_NOISE_SIZE, _NOISE_SIZE)).astype(np.float32)
        self._noise = np.clip(white / 2, -1, 1)

    def colours(self, sight: Sight, rays: Image, focal_px: float, light: Light, snapshot: Snapshot) -> Image:
        """Linear RGB (N, 3) along rays (N, 3), sky where nothing is met; ``focal_px`` fades the too fine."""
        met = sight.triangle >= 0
        beyond = np.flatnonzero(~met)
        pixel = _pixel(sight.distance, sight.facing, np.float32(focal_px))
        albedo = _albedo(
            sight.triangle,
            sight.barycentric,
            pixel,
            self._surface,
            self._corners,
            self._tint,
            self._noise,
            _CONTRAST,
            np.float32(self._section.half_width if self._section.paved else 0),
        )
        self._picture(albedo, sight, pixel)
        if len(beyond) < len(rays):
            surface = np.where(met, self._surface[sight.triangle], Surface.NONE)
            light.shine(albedo, surface, sight, snapshot)
        albedo[beyond] = light.sky(rays[beyond])
        return albedo

    def _picture(self, albedo: Image, sight: Sight, pixel: Image) -> None:
        """Put faces and plates on albedo (N, 3), from versions shrunk to what a pixel can resolve."""
        pictured = np.flatnonzero((sight.triangle >= 0) & self._pictured[sight.triangle])
        triangle = sight.triangle[pictured]
        uv = _uv(triangle, sight.barycentric[pictured], self._corners)
        thing = self._thing[triangle]
        for index in np.unique(thing):
            own = thing == index
            albedo[pictured[own]] = _texture(self._things[int(index)], uv[own], pixel[pictured[own]])


def _texture(thing: Thing, uv: Image, pixel: Image) -> Image:
    texture = thing.texture
    assert texture is not None
    shown: NDArray[Any] = texture
    texels = float(np.median(pixel)) * texture.shape[1] / (0.52 if texture.shape[1] > 500 else 0.225)
    if texels > 1:
        size = [max(round(n / texels), 2) for n in texture.shape[:2]]
        shown = cv2.resize(texture, (size[1], size[0]), interpolation=cv2.INTER_AREA)
    height, width = shown.shape[:2]
    # remap takes images of up to 32767 rows: the hits of one quad go through in pieces.
    pieces = [
        cv2.remap(
            shown,
            (piece[:, :1] * width - 0.5).astype(np.float32),
            (piece[:, 1:] * height - 0.5).astype(np.float32),
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for piece in np.array_split(uv, len(uv) // 30000 + 1)
    ]
    values = np.concatenate(pieces).reshape(-1, 3).astype(np.float32) / 255
    return np.asarray(values**2.2 * 0.9, np.float32)


@compiled
def _pixel(distance: Image, facing: Image, focal_px: np.float32) -> Image:
    """Width (N,) of what a pixel covers on the surface it shows, m."""
    pixel = np.empty(len(distance), np.float32)
    for i in range(len(distance)):
        pixel[i] = distance[i] / focal_px / max(facing[i], np.float32(0.15))
    return pixel


@compiled
def _uv(triangle: NDArray[np.int32], barycentric: Image, corners: Image) -> Image:
    """Texture coordinates (N, 2)."""
    uv = np.empty((len(triangle), 2), np.float32)
    for i in range(len(triangle)):
        corner = corners[triangle[i]]
        for k in range(2):
            second = barycentric[i, 0] * (corner[1, k] - corner[0, k])
            uv[i, k] = corner[0, k] + second + barycentric[i, 1] * (corner[2, k] - corner[0, k])
    return uv


@compiled
def _albedo(
    triangle: NDArray[np.int32],
    barycentric: Image,
    pixel: Image,
    surfaces: NDArray[np.uint8],
    corners: Image,
    tint: Image,
    noise: Image,
    contrast: Image,
    edge: np.float32,
) -> Image:
    """Albedo (N, 3) with grain, lane markings, painted bumps, paving joints and windows; zero for the sky.

    tint, surfaces, corners : albedo (T, 3), id (T,) and texture coordinates (T, 3, 2) of triangles.
    contrast : (3, S), of each level of the noise by surface.  edge : offset of the lane's edge, 0 for none.
    """
    albedo = np.zeros((len(triangle), 3), np.float32)
    uv = _uv(np.maximum(triangle, 0), barycentric, corners)
    for i in range(len(triangle)):
        if triangle[i] < 0:
            continue
        surface, u, v, width = surfaces[triangle[i]], uv[i, 0], uv[i, 1], pixel[i]
        grain = np.float32(1)
        for level in range(3):
            seen = min(np.float32(1.5) * _TEXELS_M[level] / width, np.float32(1))
            fade = contrast[level, surface] * seen * np.sqrt(seen)
            grain += fade * _sampled(noise, u / _TEXELS_M[level], v / _TEXELS_M[level])
        paint = _painted(surface, u, v, width, edge)
        for k in range(3):
            colour = tint[triangle[i], k] if paint < 0 else _PAINTS[paint, k]
            albedo[i, k] = colour * max(grain, np.float32(0.15))
    return albedo


@compiled
def _sampled(noise: Image, u: np.float32, v: np.float32) -> np.float32:
    """The periodic noise at (u, v) texels, bilinear."""
    size = len(noise)
    column, row = np.floor(u), np.floor(v)
    right, low = u - column, v - row
    j, i = np.int64(column) % size, np.int64(row) % size
    j1, i1 = (j + 1) % size, (i + 1) % size
    top = noise[i, j] + right * (noise[i, j1] - noise[i, j])
    bottom = noise[i1, j] + right * (noise[i1, j1] - noise[i1, j])
    return top + low * (bottom - top)


@compiled
def _painted(surface: int, u: np.float32, v: np.float32, pixel: np.float32, edge: np.float32) -> int:
    """Row of _PAINTS that covers a surface at (u, v), -1 for none."""
    paint = -1
    if surface == _ASPHALT and edge > 0:
        width = np.float32(0.06) + np.float32(0.2) * min(pixel, np.float32(0.2))
        middle = abs(v) < width and u % 6 < 3
        if middle or abs(abs(v) - (edge - np.float32(0.2))) < width:
            paint = 0
    elif surface == _BUMP and v % 1 < 0.5:
        paint = 1
    elif surface == _SIDEWALK and pixel < 0.06 and (u % 0.5 < 0.015 or v % 0.5 < 0.015):
        paint = 2
    elif surface == _FACADE:
        across, up = abs(u / 2.6 % 1 - 0.5), (v - 1) / 2.9
        middle_m = abs(up % 1 - 0.52)
        if across < 0.235 and middle_m < 0.28 and up > 0.05:
            paint = 4 if across < 0.2 and middle_m < 0.24 else 3
    return paint
