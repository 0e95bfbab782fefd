"""Packing of shards against ``tar | sha256sum`` in the same run, and what a takedown of one frame writes."""

import hashlib
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from cost import cpu_s

from card.packaging.shards import Source, write_shards

FILES, FILE_BYTES = 200, 1_000_000
SHARD_BYTES = 4_000_000_000
# A release in small: drives of three shards a modality, with files of a sixtieth of the size.
DRIVES, FRAMES, SHARD_FRAMES = 8, 300, 100
MEAN_BYTES = {
    "camera_left": 20_000, "camera_right": 20_000, "lidar_front": 5_000, "lidar_rear": 5_000,
    "ground_truth": 50_000, "labels": 60,
}  # fmt: skip


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

    rewritten = takedown(scratch / "release")
    ratio = cpu_s(baseline, repeats) / cpu_s(pack, repeats)
    row = {"stage": "packaging", "figure": "pack_ratio", "value": ratio, "unit": "1"}
    taken = {"stage": "packaging", "figure": "takedown_bytes_rewritten_pct", "value": rewritten, "unit": "%"}
    return [row | {"aim": 0.8, "better": "higher"}, taken | {"aim": None, "better": "lower"}]


def takedown(folder: Path) -> float:
    """Bytes of shards that are not taken over when one frame goes, by the bytes of all shards, in %."""
    random = np.random.default_rng(1)
    total = written = 0
    for drive in range(DRIVES):
        for modality, mean in MEAN_BYTES.items():
            sources = []
            for frame in range(FRAMES):
                content = random.bytes(int(random.uniform(0.5, 1.5) * mean))
                name = f"d{drive}/{frame:06d}.{modality}.bin"
                sources.append(Source(name, frame, content, hashlib.sha256(content).hexdigest()))
            old, new = folder / "old" / f"d{drive}", folder / "new" / f"d{drive}"
            old.mkdir(parents=True, exist_ok=True)
            new.mkdir(parents=True, exist_ok=True)
            limits = {"max_bytes": SHARD_BYTES, "numbers": SHARD_FRAMES}
            write_shards(sources, old, modality, **limits)
            taken = drive == 0 and not modality.startswith("lidar_")
            kept = [source for source in sources if not taken or source.number != FRAMES // 2]
            write_shards(kept, new, modality, **limits, previous=old)
            for path in new.glob(f"{modality}-*"):
                total += path.stat().st_size
                written += 0 if path.samefile(old / path.name) else path.stat().st_size
    shutil.rmtree(folder)
    return 100 * written / total
