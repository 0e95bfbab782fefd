"""How numerical kernels are compiled: to machine code that is cached beside the source."""

from typing import Any

import numba

#: Decorator of a kernel. Floating point follows IEEE 754 in the order written, so a kernel can agree bit by
#: bit with a reference in numpy. A kernel calls compiled functions of its own file only: the cache does not
#: notice a change in another.
compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")
