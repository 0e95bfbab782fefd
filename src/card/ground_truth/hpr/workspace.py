"""Memory that is used again from one cloud to the next."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

#: Room above what is asked for, so that a slightly larger cloud finds room too.
SPARE = 1.2


class Workspace:
    """Named buffers that grow with need. One belongs to one thread."""

    def __init__(self) -> None:
        self._buffers: dict[str, npt.NDArray[Any]] = {}

    def take(self, name: str, shape: int | tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """An array of this shape with any content; it is the same memory at every call by this name."""
        size = prod(shape) if isinstance(shape, tuple) else shape
        buffer = self._buffers.get(name)
        if buffer is None or buffer.size < size:
            buffer = self._buffers[name] = np.empty(int(size * SPARE), dtype)
        return buffer[:size].reshape(shape)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(buffer.nbytes for buffer in self._buffers.values())
