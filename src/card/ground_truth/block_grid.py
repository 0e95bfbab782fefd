"""Voxels of a part of the world in blocks of 8 x 8 x 8, found by their place in two steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from card.ground_truth.compiled import compiled
from card.ground_truth.voxels import AXIS_BITS

Index = npt.NDArray[np.int64]
Ints = npt.NDArray[np.int32]
Words = npt.NDArray[np.uint64]

#: Empty blocks round the voxels: a search within 8 voxels of one never leaves the grid.
_BORDER = 1


class BlockGrid(NamedTuple):
    """V voxels in B blocks.

    low: (3,) grid index of cell (0, 0, 0), a whole number of blocks. block: (X, Y, Z) int32, -1 for empty.
    number: (B, 8, 64) int32, of the voxel at cell (x, y, z) of a block under [x, 8 y + z], -1 for none.
    bits: (B, 8) the same as bits, for a first look. bounds: (B, 6) int8, lowest and highest occupied x, y, z.
    """

    low: Index
    block: Ints
    number: Ints
    bits: Words
    bounds: npt.NDArray[np.int8]


def block_grid(keys: Index, inside: Index) -> BlockGrid:
    """The grid of the voxels of keys (V,) that also spans the grid indices `inside` (M, 3), M > 0."""
    low, high = inside.min(axis=0), inside.max(axis=0)
    _stretch(keys, low, high)
    low = (low >> 3) - _BORDER
    shape = (high >> 3) + _BORDER + 1 - low
    low <<= 3
    block = np.full((int(shape[0]), int(shape[1]), int(shape[2])), -1, dtype=np.int32)
    blocks = _number(keys, low, block)
    number = np.full((blocks, 8, 64), -1, dtype=np.int32)
    bits = np.zeros((blocks, 8), dtype=np.uint64)
    bounds = np.empty((blocks, 6), dtype=np.int8)
    bounds[:, :3], bounds[:, 3:] = 7, 0
    _enter(keys, low, block, number, bits, bounds)
    return BlockGrid(low, block, number, bits, bounds)


@compiled
def _cell(key: int) -> tuple[int, int, int]:
    mask = (1 << AXIS_BITS) - 1
    return key >> 2 * AXIS_BITS, key >> AXIS_BITS & mask, key & mask


@compiled
def _stretch(keys: Index, low: Index, high: Index) -> None:
    for key in keys:
        x, y, z = _cell(key)
        low[0], low[1], low[2] = min(low[0], x), min(low[1], y), min(low[2], z)
        high[0], high[1], high[2] = max(high[0], x), max(high[1], y), max(high[2], z)


@compiled
def _number(keys: Index, low: Index, block: Ints) -> int:
    blocks = 0
    for key in keys:
        x, y, z = _cell(key)
        at = (x - low[0]) >> 3, (y - low[1]) >> 3, (z - low[2]) >> 3
        if block[at] < 0:
            block[at] = blocks
            blocks += 1
    return blocks


@compiled
def _enter(
    keys: Index, low: Index, block: Ints, number: Ints, bits: Words, bounds: npt.NDArray[np.int8]
) -> None:
    for v in range(len(keys)):
        x, y, z = _cell(keys[v])
        x, y, z = x - low[0], y - low[1], z - low[2]
        b = block[x >> 3, y >> 3, z >> 3]
        x, y, z = x & 7, y & 7, z & 7
        number[b, x, y << 3 | z] = v
        bits[b, x] |= np.uint64(1) << np.uint64(y << 3 | z)
        box = bounds[b]
        box[0], box[1], box[2] = min(box[0], x), min(box[1], y), min(box[2], z)
        box[3], box[4], box[5] = max(box[3], x), max(box[4], y), max(box[5], z)
