"""Whether the disk can hold what a run is about to make."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from card.errors import CardError

#: Results of a sequence, in multiples of its raw bytes: anonymized images, ground truth, shards.
RESULTS_PER_RAW = 3
#: Raw bytes of one simulated drive a scale, rounded up: tiny and demo as made, full as the paper's sequences.
SIMULATED_BYTES = {"tiny": 5_000_000, "demo": 100_000_000, "full": 12_000_000_000}


def require_space(work: Path, recordings: Sequence[Path], simulated: int, scale: str) -> None:
    """Check the free space of the file system that holds ``work``.

    Parameters
    ----------
    recordings : raw folders whose results are still to be made; one that does not exist counts nothing.
    simulated : number of drives still to be simulated at ``scale``.

    Raises
    ------
    CardError
        If raw data to simulate, results and shards need more than there is.
    """
    raw = sum(_bytes(folder) for folder in recordings)
    drives = simulated * SIMULATED_BYTES[scale]
    needed = drives + RESULTS_PER_RAW * (raw + drives)
    free = shutil.disk_usage(work).free
    if needed > free:
        raise CardError(
            "not enough disk space",
            where=work.resolve(),
            found=f"{free / 1e9:.1f} GB free",
            wanted=f"{needed / 1e9:.1f} GB",
        )


def _bytes(folder: Path) -> int:
    return sum(
        os.path.getsize(os.path.join(root, name)) for root, _, names in os.walk(folder) for name in names
    )
