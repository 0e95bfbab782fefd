"""An image sensor: exposure, shot and read noise, 12 bits, gamma, JPEG."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from card.simulation.compiled import compiled

Image = NDArray[np.float32]

#: Electrons of a full well at gain 1 and of the read noise (one sigma): a 3.45 um global shutter sensor.
FULL_WELL_E, READ_NOISE_E = 10_000.0, 2.5
_LEVELS = 4096
GAMMA = 2.2
JPEG_QUALITY = 92
_TONES = np.rint(255 * (np.arange(_LEVELS) / (_LEVELS - 1)) ** (1 / GAMMA)).astype(np.uint8)


@dataclass(frozen=True)
class Exposure:
    """How a camera takes its pictures.

    time_ns : how long the shutter is open; the picture's stamp is the middle of it.
    gain : analogue gain; electrons count that many times.
    white : the light that fills the well at gain 1 in a ``time_ns`` of DAY, in units of `lighting`.
    """

    time_ns: int
    gain: float
    white: float = 0.67

    def signal(self, light: Image) -> Image:
        """Share of the sensor's range that light fills, 1 for white, not yet cut off."""
        return np.asarray(light * self._sensitivity)

    def variance(self, signal: Image) -> Image:
        """Variance of the noise at a signal: shot noise grows with the light, read noise does not."""
        return np.asarray(self._electron * signal + (READ_NOISE_E * self._electron) ** 2, np.float32)

    def taken(self, light: Image, vignetting: Image, rng: np.random.Generator) -> NDArray[np.uint8]:
        """The picture (H, W, 3) of light (H, W, 3) behind a lens that lets a share (H, W) of it through.

        With noise, read out in 12 bits, and in 8 bits after gamma 2.2.
        """
        noise = rng.standard_normal(light.shape, np.float32)
        floor = np.float32((READ_NOISE_E * self._electron) ** 2)
        return np.asarray(
            _read_out(light, vignetting * self._sensitivity, noise, self._electron, floor, _TONES)
        )

    @property
    def _sensitivity(self) -> np.float32:
        return np.float32(self.gain * self.time_ns / (DAY.time_ns * self.white))

    @property
    def _electron(self) -> np.float32:
        """Signal of one electron."""
        return np.float32(self.gain / FULL_WELL_E)


DAY, NIGHT = Exposure(1_500_000, 1.0), Exposure(8_000_000, 64.0)


@compiled
def _read_out(
    light: Image,
    sensitivity: Image,
    noise: Image,
    electron: np.float32,
    floor: np.float32,
    tones: NDArray[np.uint8],
) -> NDArray[np.uint8]:
    picture = np.empty(light.shape, np.uint8)
    top = len(tones) - 1
    for i in range(light.shape[0]):
        for j in range(light.shape[1]):
            for k in range(3):
                signal = light[i, j, k] * sensitivity[i, j]
                signal += noise[i, j, k] * np.sqrt(electron * signal + floor)
                level = min(max(signal * np.float32(top) + np.float32(0.5), 0), top)
                picture[i, j, k] = tones[int(level)]
    return picture


def jpeg(picture: NDArray[np.uint8]) -> bytes:
    """A picture (H, W, 3), RGB, as the camera compresses it, 4:2:0."""
    parameters = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    ok, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), parameters)
    assert ok
    return bytes(data)
