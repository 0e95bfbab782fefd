"""Lossless redaction: one constant in the masked MCU blocks, every other DCT coefficient as it was."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import jpeglib
import numpy as np
import numpy.typing as npt

from card.errors import CardError
from card.privacy.detection import Detection
from card.privacy.markers import check_released

FILL = 128
"""Value of every channel in a redacted pixel: all-zero DCT coefficients give it, whatever the tables."""

Area = tuple[int, int, int, int]
"""Redacted pixels of one box: x_min, y_min, x_max, y_max; the maxima are excluded."""


@dataclass(frozen=True)
class Redacted:
    """A redacted JPEG file, the area of each box and the number of pixels under any of them."""

    content: bytes
    areas: list[Area]
    pixels: int


def redact(content: bytes, detections: Sequence[Detection], *, dilation_px: float, where: object) -> Redacted:
    """Fill the MCU blocks that the dilated boxes touch and check what came out.

    Parameters
    ----------
    content : a sanitized JPEG file (``card.privacy.markers.sanitized``).
    detections : boxes in pixels of the image; they may overlap each other and the border.
    dilation_px : margin around each box, in pixels, before the alignment to MCUs.

    Quantization tables and chroma layout are kept; progressive scans and restart intervals become one plain
    scan of the same coefficients. Raises ``CardError`` for an image that cannot be read, a box outside it,
    and an output that fails its check.
    """
    original = _read(content, where)
    step_y, step_x = _mcu_size(original)
    shape = (original.height, original.width)
    areas = [_area(box, shape, (step_y, step_x), dilation_px, where) for box in detections]
    mask = np.zeros((-(-shape[0] // step_y), -(-shape[1] // step_x)), dtype=bool)
    for x_min, y_min, x_max, y_max in areas:
        mask[y_min // step_y : -(-y_max // step_y), x_min // step_x : -(-x_max // step_x)] = True

    before = [blocks.copy() for blocks in _components(original)]
    original.markers = []  # jpeglib would write the input's header beside its own
    for blocks, masked in zip(_components(original), _block_masks(original, mask), strict=True):
        blocks[masked] = 0
    output = _written(original, where)

    pixels = mask.repeat(step_y, axis=0).repeat(step_x, axis=1)[: shape[0], : shape[1]]
    check_released(output, where)
    _check_coefficients(original, before, _read(output, where), mask, where)
    _check_pixels(output, pixels, where)
    return Redacted(output, areas, int(pixels.sum()))


def _read(content: bytes, where: object) -> Any:
    with tempfile.NamedTemporaryFile(suffix=".jpg") as file:
        file.write(content)
        file.flush()
        try:
            image = jpeglib.read_dct(file.name)
            image.load()
        except OSError as error:
            raise CardError("unreadable JPEG", where=where, found=error) from error
    return image


def _written(image: Any, where: object) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "redacted.jpg"
        try:
            image.write_dct(str(path))
        except OSError as error:
            raise CardError("redacted JPEG could not be written", where=where, found=error) from error
        return path.read_bytes()


def _components(image: Any) -> list[npt.NDArray[np.int16]]:
    """DCT coefficients (rows, columns, 8, 8) of Y, or of Y, Cb and Cr."""
    return [image.Y, image.Cb, image.Cr] if image.has_chrominance else [image.Y]


def _mcu_size(image: Any) -> tuple[int, int]:
    """Height and width of an MCU in pixels."""
    rows, columns = (8 * int(factor) for factor in image.samp_factor.max(axis=0))
    return rows, columns


def _block_masks(image: Any, mask: npt.NDArray[np.bool_]) -> list[npt.NDArray[np.bool_]]:
    """The MCU mask in blocks of each component."""
    masks = []
    for blocks, (rows, columns) in zip(_components(image), image.samp_factor, strict=True):
        fine = mask.repeat(rows, axis=0).repeat(columns, axis=1)
        masks.append(fine[: blocks.shape[0], : blocks.shape[1]])
    return masks


def _area(
    box: Detection, shape: tuple[int, int], step: tuple[int, int], dilation_px: float, where: object
) -> Area:
    edges = np.array([box.x_min, box.y_min, box.x_max, box.y_max])
    size = np.array([shape[1], shape[0]])
    if not np.isfinite(edges).all() or (edges[2:] <= edges[:2]).any():
        raise CardError("box without an extent", where=where, found=edges.tolist())
    # Pixel i reaches from i - 0.5 to i + 0.5: every pixel the box touches goes.
    low = np.clip(np.floor(edges[:2] - dilation_px + 0.5), 0, None).astype(int)
    high = np.minimum(np.ceil(edges[2:] + dilation_px + 0.5), size).astype(int)
    if (low >= high).any():
        raise CardError(
            "box outside the image", where=where, found=edges.tolist(), wanted=f"within {size.tolist()}"
        )
    step_xy = np.array(step[::-1])
    low = low // step_xy * step_xy
    high = np.minimum(-(-high // step_xy) * step_xy, size)
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _check_coefficients(
    original: Any,
    before: Sequence[npt.NDArray[np.int16]],
    output: Any,
    mask: npt.NDArray[np.bool_],
    where: object,
) -> None:
    same_layout = (
        (original.height, original.width) == (output.height, output.width)
        and np.array_equal(original.samp_factor, output.samp_factor)
        and np.array_equal(original.qt[original.quant_tbl_no], output.qt[output.quant_tbl_no])
    )
    if not same_layout:
        raise CardError("redaction changed the size, chroma layout or quantization tables", where=where)
    pairs = zip(before, _components(output), _block_masks(original, mask), strict=True)
    for blocks, after, masked in pairs:
        if after[masked].any():
            raise CardError("redacted area is not constant", where=where)
        # Zeros under the mask on both sides: comparing whole arrays costs less than picking blocks.
        blocks[masked] = 0
        if not np.array_equal(blocks, after):
            raise CardError("redaction changed the image outside its mask", where=where)


def _check_pixels(output: bytes, pixels: npt.NDArray[np.bool_], where: object) -> None:
    """Decode as a user's reader would, with another libjpeg than the one that wrote."""
    data = np.frombuffer(output, dtype=np.uint8)
    grey = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE)
    colour = cv2.imdecode(data, cv2.IMREAD_COLOR)
    if grey is None or colour is None or grey.shape != pixels.shape:
        raise CardError("redacted image cannot be decoded to its size", where=where)
    # Chroma upsampling lets the surroundings reach one pixel into the area.
    inside = cv2.erode(pixels.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    if (grey[pixels] != FILL).any() or (colour[inside] != FILL).any():
        raise CardError("redacted area is not constant", where=where)
