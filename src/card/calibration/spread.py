"""Some of many, evenly."""

import numpy as np
from numpy.typing import NDArray


def spread(count: int, most: int) -> NDArray[np.intp]:
    """At most so many ordinals, evenly over 0 to count - 1."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.intp))
