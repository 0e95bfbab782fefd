"""The privacy stage at the size of a real image: redaction beside detection, and what a blur would cost."""

import resource
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from cost import cpu_s

from card.artifacts import default_settings
from card.privacy.detection import Detection
from card.privacy.detectors import detectors_of
from card.privacy.jobs import read_image
from card.privacy.redaction import redact

HEIGHT, WIDTH = 2252, 2248
BOXES = 20


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Rows `redaction_overhead_pct`, `images_per_s`, `peak_gb` and the ratio to decode, blur, encode."""
    from skimage import data

    path = scratch / "street.jpg"
    photograph = cv2.resize(data.astronaut()[..., ::-1], (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(path), photograph, [cv2.IMWRITE_JPEG_QUALITY, 92])
    settings = default_settings("privacy")
    detectors = detectors_of(settings)
    _, content, image = read_image(path)
    boxes = [
        Detection("face", 80.0 * k, 90.0 * k, 80.0 * k + 60, 90.0 * k + 70, 1.0, "benchmark", "")
        for k in range(BOXES)
    ]

    def detect() -> None:
        for detector in detectors:
            detector.detect(image)

    def fill() -> None:
        redact(content, boxes, dilation_px=settings["dilation_px"], where=path)

    def blur() -> None:
        pixels: Any = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
        for box in boxes:
            part = pixels[int(box.y_min) : int(box.y_max), int(box.x_min) : int(box.x_max)]
            part[:] = cv2.GaussianBlur(part, (0, 0), 0.2 * box.size[0])
        cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 95])

    detection, redaction, blurring = (cpu_s(work, repeats) for work in (detect, fill, blur))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return [
        _row("redaction_overhead_pct", 100 * redaction / detection, "%", 10, "lower"),
        _row("images_per_s", 1 / (detection + redaction), "1/CPU-s", None, "higher"),
        _row("images_per_s_detection_only", 1 / detection, "1/CPU-s", None, "higher"),
        _row("redaction_to_blur_ratio", redaction / blurring, "1", None, "lower"),
        _row("peak_gb", peak, "GB", 2, "lower"),
    ]


def _row(figure: str, value: float, unit: str, aim: float | None, better: str) -> dict[str, Any]:
    return {"stage": "privacy", "figure": figure, "value": value, "unit": unit, "aim": aim, "better": better}
