"""Packing of shards against ``tar | sha256sum`` on the same files in the same run."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from cost import cpu_s

from card.packaging.shards import Source, write_shards

FILES, FILE_BYTES = 200, 1_000_000
SHARD_BYTES = 4_000_000_000


def rows(scratch: Path, repeats: int) -> list[dict[str, Any]]:
    """Row `pack_ratio`: CPU time of the baseline by that of packing, which hashes and indexes each file."""
    raw, packed = scratch / "raw", scratch / "packed"
    raw.mkdir(parents=True)
    random = np.random.default_rng(0)
    for index in range(FILES):
        (raw / f"{index:06d}.bin").write_bytes(random.bytes(FILE_BYTES))

    def pack() -> None:
        shutil.rmtree(packed, ignore_errors=True)
        packed.mkdir()
        sources = (Source(path.name, int(path.stem), path) for path in raw.iterdir())
        write_shards(sources, packed, "raw", max_bytes=SHARD_BYTES, numbers=FILES)

    def baseline() -> None:
        command = f"tar -cf - -C '{raw}' . | sha256sum"
        subprocess.run(command, shell=True, check=True, stdout=subprocess.DEVNULL)

    ratio = cpu_s(baseline, repeats) / cpu_s(pack, repeats)
    row = {"stage": "packaging", "figure": "pack_ratio", "value": ratio, "unit": "1"}
    return [row | {"aim": 0.8, "better": "higher"}]
