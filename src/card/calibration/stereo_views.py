"""The stereo pairs of a calibration session or of a survey."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from card.errors import CardError
from card.recording.paths import CAMERAS, list_images, stamp_of


@dataclass(frozen=True)
class View:
    """One stereo pair: its name, and the image of each camera, left and right."""

    name: str
    images: tuple[Path, Path]


def list_views(session: Path, max_delay_ms: float) -> tuple[list[View], list[str]]:
    """Stereo pairs of a session or a survey in order of time, and a note for each image without a partner."""
    if (session / CAMERAS[0]).is_dir():
        folders = [session]
    else:
        folders = sorted(path.parent for path in session.glob(f"survey-*/pose-*/{CAMERAS[0]}"))
    views, notes = [], []
    for folder in folders:
        left, right = (list_images(folder, camera) for camera in CAMERAS)
        stamps = np.array([stamp_of(path) for path in right], dtype=np.int64)
        alone = set(right)
        for path in left:
            delay = np.abs(stamps - stamp_of(path))
            if not len(delay) or delay.min() > max_delay_ms * 1e6:
                notes.append(f"{path.relative_to(session)} has no right image within {max_delay_ms:g} ms")
                continue
            partner = right[int(np.argmin(delay))]
            alone.discard(partner)
            views.append(View(_name(session, folder, path, len(left)), (path, partner)))
        notes += [f"{path.relative_to(session)} has no left image" for path in sorted(alone)]
    if not views:
        raise CardError(
            "no stereo pairs",
            where=session,
            found=notes[0] if notes else None,
            wanted="camera_left, camera_right",
        )
    return views, notes


def _name(session: Path, folder: Path, image: Path, count: int) -> str:
    if folder == session:
        return image.stem
    name = folder.relative_to(session).as_posix()
    return name if count == 1 else f"{name}/{image.stem}"
