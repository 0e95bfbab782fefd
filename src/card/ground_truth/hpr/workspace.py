"""Memory that is used again from one cloud to the next."""

from __future__ import annotations

from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

#: Room above what is asked for, so that a slightly larger cloud finds room too.
SPARE = 1.2


class Workspace:
    """Named buffers that grow with need. One belongs to one user in one thread."""

    def __init__(self) -> None:
        self._buffers: dict[tuple[str, str], npt.NDArray[Any]] = {}

    def take(self, name: str, shape: int | tuple[int, ...], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
        """An array of this shape with any content: the same memory at every call by this name and type."""
        size = prod(shape) if isinstance(shape, tuple) else shape
        key = name, np.dtype(dtype).str
        buffer = self._buffers.get(key)
        if buffer is None or buffer.size < size:
            buffer = self._buffers[key] = np.empty(int(size * SPARE), dtype)
        return buffer[:size].reshape(shape)

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return sum(buffer.nbytes for buffer in self._buffers.values())
