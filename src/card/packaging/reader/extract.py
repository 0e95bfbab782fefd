"""Take single files out of a release's shards."""

import hashlib
from collections.abc import Collection
from pathlib import Path

from card.artifacts import atomic_file, progress
from card.errors import CardError
from card.packaging.reader.release import Release


def extract(
    release: Release,
    out: Path,
    *,
    sequences: Collection[str] = (),
    split: str | None = None,
    modalities: Collection[str] = (),
    frames: Collection[int] = (),
) -> int:
    """Write the chosen members under `out` by their names; nothing given chooses all. Returns their number.

    A LiDAR's bursts are chosen by the frames they belong to. A file that is there with the right bytes is
    not read again. CardError if nothing is chosen, and for damaged content.
    """
    wanted = None
    if split or frames:
        wanted = {
            key
            for frame in release.iterate(split)
            if not frames or frame.number in frames
            for key in (
                (frame.sequence, None, frame.number),
                *(
                    (frame.sequence, lidar, frame.row[f"{lidar}_burst"])
                    for lidar in ("lidar_front", "lidar_rear")
                ),
            )
        }
    chosen = [
        (key, name)
        for key, name in release.names()
        if (not sequences or key[0] in sequences)
        and (not modalities or key[1] in modalities)
        and (wanted is None or (key[0], key[1] if key[1].startswith("lidar_") else None, key[2]) in wanted)
    ]
    if not chosen:
        raise CardError("nothing of the release is chosen", where=release.tree)
    for (sequence, modality, number), name in progress(chosen, "extract"):
        target = out / name
        if target.is_file() and _sha256(target) == release.sha256(sequence, number, modality):
            continue
        with atomic_file(target) as partial:
            partial.write_bytes(release.read(sequence, number, modality))
    return len(chosen)


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
