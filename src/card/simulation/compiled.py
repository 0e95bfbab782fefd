"""The compiler of what has to be done for each pixel."""

from typing import Any

import numba

#: Compiled once a machine; without fast maths, so that bytes do not depend on the processor.
compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
