"""Textures of what a street holds that is private: faces and number plates."""

import functools

import cv2
import numpy as np
from numpy.typing import NDArray

from card.errors import CardError

FACE_SIZE_M = (0.27, 0.225)
"""Height and width of the patch a face texture covers (hair to chin, hair to hair)."""
PLATE_SIZE_M = (0.11, 0.52)
"""Height and width of a European number plate."""

_FACE_SHAPE = (192, 160)
_FACE_CENTRE = (225.0, 108.0)  # x, y of the crop in the photograph
_FACE_SCALE = 192 / 180.0  # texture pixels a photograph pixel

_BLUE, _WHITE, _INK, _YELLOW = (0, 51, 153), (238, 238, 234), (16, 16, 20), (255, 204, 0)
_LETTERS = "ABCDEFGHJKLMNPRSTVWXYZ"  # without those that read as digits
_DISTRICTS = ("B", "M", "K", "HH", "S", "UL", "KA", "FR", "TUT", "RW", "FDS", "BB", "ES")


@functools.cache
def _photograph() -> NDArray[np.uint8]:
    from skimage import data

    return np.asarray(data.astronaut(), dtype=np.uint8)


def face_texture(index: int) -> NDArray[np.uint8]:
    """A frontal face, (192, 160, 3) uint8 RGB, to be laid on a patch of FACE_SIZE_M.

    The same index gives the same face. Crop, head roll, tone and side vary with the index; the
    photograph (Eileen Collins, NASA, public domain) comes with scikit-image.
    """
    rng = np.random.default_rng([0xFACE, index])
    scale = _FACE_SCALE * rng.uniform(0.95, 1.08)
    roll = rng.uniform(-4.0, 4.0)
    matrix = np.asarray(cv2.getRotationMatrix2D(_FACE_CENTRE, roll, scale), dtype=np.float64)
    height, width = _FACE_SHAPE
    matrix[:, 2] += np.subtract((width / 2, height / 2), _FACE_CENTRE) + rng.uniform(-4.0, 4.0, 2)
    face = cv2.warpAffine(_photograph(), matrix, (width, height), flags=cv2.INTER_AREA)
    if index % 2:
        face = face[:, ::-1]
    tone = rng.uniform(0.75, 1.05) * rng.uniform(0.94, 1.06, 3)
    gamma = rng.uniform(0.85, 1.3)
    toned = 255.0 * (face / 255.0) ** gamma * tone
    return np.clip(np.rint(toned), 0, 255).astype(np.uint8)


def plate_texture(country: str, rng: np.random.Generator) -> NDArray[np.uint8]:
    """A number plate, (220, 1040, 3) uint8 RGB (2 px a mm), to be laid on PLATE_SIZE_M.

    country : ISO code, "DE" (district, seals, letters, digits) or "IT" (AA 000 AA between two bands).
    The number is drawn from `rng` and belongs to nobody.
    """
    plate = np.empty((220, 1040, 3), np.uint8)
    plate[:] = _WHITE
    _draw_eu_band(plate, {"DE": "D", "IT": "I"}.get(country, ""))
    if country == "DE":
        district = str(rng.choice(_DISTRICTS))
        letters = _word(rng, 2 if len(district) < 3 else 1)
        digits = str(rng.integers(10, 1000))
        left = _draw_text(plate, district, 115)
        for y, colour in ((72, (200, 120, 40)), (150, (90, 110, 160))):  # inspection and state seals
            cv2.circle(plate, (left + 38, y), 28, colour, -1, cv2.LINE_AA)
        _draw_text(plate, f"{letters} {digits}", left + 80)
    elif country == "IT":
        plate[:, 960:] = _BLUE
        cv2.circle(plate, (1000, 70), 24, _YELLOW, 4, cv2.LINE_AA)
        _draw_text(plate, f"{_word(rng, 2)} {rng.integers(0, 1000):03d} {_word(rng, 2)}", 125)
    else:
        raise CardError("no number plate is drawn for this country", found=country, wanted="DE or IT")
    cv2.rectangle(plate, (3, 3), (1036, 216), _INK, 5, cv2.LINE_AA)
    return plate


def _word(rng: np.random.Generator, length: int) -> str:
    return "".join(rng.choice(list(_LETTERS), length))


def _draw_eu_band(plate: NDArray[np.uint8], letter: str) -> None:
    plate[:, :84] = _BLUE
    for angle in np.arange(12) * np.pi / 6:
        centre = (round(42 + 26 * np.sin(angle)), round(70 - 26 * np.cos(angle)))
        cv2.circle(plate, centre, 4, _YELLOW, -1, cv2.LINE_AA)
    cv2.putText(plate, letter, (22, 190), cv2.FONT_HERSHEY_SIMPLEX, 2.0, _WHITE, 7, cv2.LINE_AA)


def _draw_text(plate: NDArray[np.uint8], text: str, left: int) -> int:
    """Draw in 75 mm high characters; the right edge of what was drawn."""
    font, scale, thickness = cv2.FONT_HERSHEY_SIMPLEX, 5.0, 19
    for character in text:
        (width, height), _ = cv2.getTextSize(character, font, scale, thickness)
        if character == " ":
            left += 36
            continue
        cell = np.full((220, width + 20, 3), _WHITE, np.uint8)
        cv2.putText(cell, character, (10, 110 + height // 2), font, scale, _INK, thickness, cv2.LINE_AA)
        narrow = cv2.resize(cell, (round(0.74 * cell.shape[1]), 220), interpolation=cv2.INTER_AREA)
        stop = left + narrow.shape[1]
        plate[:, left:stop] = narrow
        left = stop
    return left
