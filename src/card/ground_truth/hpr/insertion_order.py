"""The order in which points enter the triangulation.

Neighbours follow each other on a Morton curve through the cells, so the walk to the next point is short. The
nearest point of each block of cells comes first, from coarse blocks to fine ones: what is hidden then mostly
finds what hides it already in place. Amenta, Choi and Rote, "Incremental Constructions con BRIO", SoCG 2003.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from card.ground_truth.compiled import compiled

#: Bits of a Morton number that each of the two sorting passes looks at.
_DIGIT = 13
#: Blocks of 16 x 16 cells, 4 x 4 cells, then single ones, as bits of the Morton number.
_BLOCKS = (12, 8, 4)


@compiled
def _spread(bits: int) -> int:
    """Thirteen bits, each followed by a zero."""
    bits = (bits | (bits << 8)) & 0x00FF00FF
    bits = (bits | (bits << 4)) & 0x0F0F0F0F
    bits = (bits | (bits << 2)) & 0x33333333
    return (bits | (bits << 1)) & 0x55555555


@compiled
def morton_order(place: Any, unsorted: Any, order: Any, morton: Any) -> None:
    """Sort points by the Morton number of their places; the order given holds within a place.

    place : (M, 2) along u and v. unsorted, order, morton : (M,) uint32; the numbers as they come, the
    permutation, and the numbers in order.
    """
    mask = (1 << _DIGIT) - 1
    starts = np.zeros((2, (1 << _DIGIT) + 1), np.int64)
    for i in range(order.size):
        number = _spread(np.int64(place[i, 0])) | (_spread(np.int64(place[i, 1])) << 1)
        unsorted[i] = number
        starts[0, (number & mask) + 1] += 1
        starts[1, (number >> _DIGIT) + 1] += 1
    for digit in range(1 << _DIGIT):
        starts[0, digit + 1] += starts[0, digit]
        starts[1, digit + 1] += starts[1, digit]
    for i in range(order.size):
        digit = unsorted[i] & mask
        morton[starts[0, digit]] = i
        starts[0, digit] += 1
    for k in range(order.size):
        i = morton[k]
        digit = unsorted[i] >> _DIGIT
        order[starts[1, digit]] = i
        starts[1, digit] += 1
    for k in range(order.size):
        morton[k] = unsorted[order[k]]


@compiled
def by_rounds(lifted: Any, morton: Any, sequence: Any, used: Any) -> None:
    """Write the order of insertion to `sequence` (M,): positions in the Morton order.

    lifted, morton : (M, 4), (M,) in Morton order. used : (M,) bool.
    """
    used[:] = False
    count = 0
    size = sequence.size
    for shift in _BLOCKS:
        i = 0
        while i < size:
            block = morton[i] >> shift
            best, nearest, j = -1, np.inf, i
            while j < size and morton[j] >> shift == block:
                if lifted[j, 3] < nearest and not used[j]:
                    best, nearest = j, lifted[j, 3]
                j += 1
            if best >= 0:
                used[best] = True
                sequence[count] = best
                count += 1
            i = j
    for i in range(size):
        if not used[i]:
            sequence[count] = i
            count += 1
