"""How a hit looks: albedo with texture, sun, sky light and shadow."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.simulation.raycast import Hits, Tracer
from card.simulation.road import CrossSection
from card.simulation.surfaces import LOOKS, Surface
from card.simulation.traffic import Thing

Array = NDArray[np.float64]
Image = NDArray[np.float32]

_ALBEDO = np.array([LOOKS[s].albedo for s in Surface], np.float32)
_FINE = np.array([LOOKS[s].fine for s in Surface], np.float32)
_COARSE = np.array([LOOKS[s].coarse for s in Surface], np.float32)
#: Width of a texel of the noise at each level, m.
_TEXELS_M = (0.018, 0.12, 0.9)
_NOISE_SIZE = 512
_PAINT = np.array([0.62, 0.62, 0.60], np.float32)
_BUMP_PAINT = np.array([0.62, 0.42, 0.05], np.float32)
_JOINT, _FRAME = np.full(3, 0.17, np.float32), np.full(3, 0.75, np.float32)
_GLASS = np.array([0.05, 0.06, 0.075], np.float32)
_SUN, _SKY_LIGHT = np.array([1.05, 1.0, 0.9], np.float32), np.array([0.36, 0.40, 0.47], np.float32)
_EXPOSURE = 1.5


class Shader:
    """Colours of hits in one world."""

    def __init__(self, tracer: Tracer, things: Sequence[Thing], section: CrossSection, sun: Array) -> None:
        self._tracer, self._things = tracer, things
        self._section, self._sun = section, sun.astype(np.float32)
        rng = np.random.default_rng(0)
        white = rng.normal(size=(_NOISE_SIZE, _NOISE_SIZE)).astype(np.float32)
        self._noise = np.clip(white / 2, -1, 1)

    def colours(self, hits: Hits, origins: Array, directions: Array, focal_px: float) -> Image:
        """Linear RGB (N, 3) of rays (N, 3), sky where nothing was met; ``focal_px`` fades the too fine."""
        out = sky(directions, self._sun)
        met = np.flatnonzero(hits.triangle >= 0)
        if not len(met):
            return out
        triangle, mesh = hits.triangle[met], self._tracer.all
        surface, thing = mesh.surface[triangle], mesh.thing[triangle]
        uv = self._tracer.uv(hits, met)
        ray = directions[met].astype(np.float32)
        normal = hits.normal[met]
        facing = np.sum(normal * ray, axis=1)
        normal = np.where(facing[:, None] > 0, -normal, normal)
        pixel = (hits.distance[met] / focal_px / np.maximum(np.abs(facing), 0.15)).astype(np.float32)
        albedo = _ALBEDO[surface] * mesh.tint[triangle]
        albedo = self._marked(albedo, surface, uv, pixel)
        albedo *= self._grain(surface, uv, pixel)[:, None]
        for index in np.unique(thing[(surface == Surface.FACE) | (surface == Surface.PLATE)]):
            pictured = np.flatnonzero(thing == index)
            albedo[pictured] = self._picture(int(index), uv[pictured], pixel[pictured])
        lit = np.maximum(normal @ self._sun, 0)
        lit[lit > 0] *= self._unshadowed(origins[met], directions[met], hits.distance[met], normal, lit > 0)
        light = lit[:, None] * _SUN + (0.55 + 0.45 * normal[:, 2:]) * _SKY_LIGHT
        out[met] = albedo * light
        return out

    def _grain(self, surface: NDArray[np.uint8], uv: Image, pixel: Image) -> Image:
        total = np.ones(len(uv), np.float32)
        for texel, contrast in zip(_TEXELS_M, (_FINE, 0.6 * _FINE, _COARSE), strict=True):
            seen = np.clip(1.5 * texel / pixel, 0, 1) ** 1.5
            total += contrast[surface] * seen * self._sample(uv / np.float32(texel))
        return np.maximum(total, 0.15)

    def _sample(self, texels: Image) -> Image:
        wrapped = np.mod(texels, _NOISE_SIZE).astype(np.float32)
        pad = -len(wrapped) % 512
        u, v = (np.pad(wrapped[:, i], (0, pad)).reshape(-1, 512) for i in (0, 1))
        values = cv2.remap(self._noise, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        return np.asarray(values.ravel()[: len(wrapped)])

    def _marked(self, albedo: Image, surface: NDArray[np.uint8], uv: Image, pixel: Image) -> Image:
        """Albedo (K, 3) with lane markings, painted bumps, paving joints and windows; changed in place."""
        for kind, paint in (
            (Surface.ASPHALT, self._lanes if self._section.paved else None),
            (Surface.BUMP, lambda u, v, _: [(np.mod(v, 1.0) < 0.5, _BUMP_PAINT)]),
            (Surface.SIDEWALK, _joints),
            (Surface.FACADE, _windows),
        ):
            chosen = np.flatnonzero(surface == kind)
            if paint is None or not len(chosen):
                continue
            for where, colour in paint(uv[chosen, 0], uv[chosen, 1], pixel[chosen]):
                albedo[chosen[where]] = colour
        return albedo

    def _lanes(self, u: Image, v: Image, pixel: Image) -> list[tuple[NDArray[np.bool_], Image]]:
        width = 0.06 + 0.2 * np.minimum(pixel, 0.2)
        middle = (np.abs(v) < width) & (np.mod(u, 6) < 3)
        edge = np.abs(np.abs(v) - (self._section.half_width - 0.2)) < width
        return [(middle | edge, _PAINT)]

    def _picture(self, thing: int, uv: Image, pixel: Image) -> Image:
        """Colours (K, 3) of a textured quad, from a version shrunk to what a pixel can resolve."""
        texture = self._things[thing].texture
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
        return np.asarray(values**2.2 * 0.9)

    def _unshadowed(
        self, origins: Array, directions: Array, distance: Array, normal: Image, lit: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        points = origins[lit] + directions[lit] * distance[lit, None] + 0.02 * normal[lit]
        return ~self._tracer.static.blocked(points, self._sun[None])


def _joints(u: Image, v: Image, pixel: Image) -> list[tuple[NDArray[np.bool_], Image]]:
    joint = (np.mod(u, 0.5) < 0.015) | (np.mod(v, 0.5) < 0.015)
    return [(joint & (pixel < 0.06), _JOINT)]


def _windows(u: Image, v: Image, pixel: Image) -> list[tuple[NDArray[np.bool_], Image]]:
    across, up = np.abs(np.mod(u / 2.6, 1) - 0.5), (v - 1.0) / 2.9
    middle = np.abs(np.mod(up, 1) - 0.52)
    frame = (across < 0.235) & (middle < 0.28) & (up > 0.05)
    return [(frame, _FRAME), (frame & (across < 0.2) & (middle < 0.24), _GLASS)]


def sky(directions: Array, sun: Array | Image) -> Image:
    """Linear RGB (N, 3) of the sky along unit vectors (N, 3) in world."""
    up = np.clip(directions[:, 2:], 0, 1) ** 0.6
    blue, haze = np.array([0.22, 0.36, 0.62]), np.array([0.62, 0.66, 0.70])
    glow = np.clip(directions @ sun, 0, 1)[:, None] ** 24
    return np.asarray(haze + up * (blue - haze) + 0.3 * glow, np.float32)


def developed(linear: Image, noise: Image) -> NDArray[np.uint8]:
    """An 8 bit picture of linear RGB (N, 3): exposure, gamma 2.2 and sensor noise in 8 bit units (N, 3)."""
    values = 255 * np.clip(_EXPOSURE * linear, 0, 1) ** np.float32(1 / 2.2)
    return np.asarray(np.clip(np.rint(values + noise), 0, 255), np.uint8)
