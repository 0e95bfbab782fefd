"""Camera topics to JPEG files."""

from __future__ import annotations

from typing import Any

import numpy as np

from card.errors import CardError
from card.recording.bag.messages import COMPRESSED_IMAGE


def jpeg_of(message: Any, kind: str, quality: int, where: object) -> bytes:
    """The JPEG of an Image or CompressedImage: the bytes themselves where it is one already.

    Raises CardError for another compression or pixel encoding.
    """
    if kind == COMPRESSED_IMAGE:
        if "jpeg" not in message.format.lower() and "jpg" not in message.format.lower():
            raise CardError(
                "image is not compressed as JPEG", where=where, found=message.format, wanted="jpeg"
            )
        return bytes(message.data)
    import cv2

    to_bgr = {"bgr8": None, "rgb8": cv2.COLOR_RGB2BGR, "mono8": None}
    if message.encoding not in to_bgr:
        raise CardError(
            "unknown pixel encoding", where=where, found=message.encoding, wanted=f"one of {sorted(to_bgr)}"
        )
    channels = 1 if message.encoding == "mono8" else 3
    if message.data.size != message.height * message.step or message.step < message.width * channels:
        raise CardError(
            "image data does not fit its size",
            where=where,
            found=f"{message.data.size} bytes",
            wanted=f"{message.width} x {message.height}, {message.encoding}",
        )
    rows = message.data.reshape(message.height, message.step)[:, : message.width * channels]
    pixels = np.ascontiguousarray(rows).reshape(message.height, message.width, channels)
    code = to_bgr[message.encoding]
    if code is not None:
        pixels = cv2.cvtColor(pixels, code)
    _, encoded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return encoded.tobytes()
