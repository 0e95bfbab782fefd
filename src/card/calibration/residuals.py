"""What an observation of a session is to the estimate: residuals and their derivatives.

A block gives residuals (V, M), in px or m, NaN where a view has fewer; and their derivatives by the shared
unknowns in its columns (V, M, S) and by the view's board pose (V, M, 6).
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from card.calibration.state import State

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Linear:
    """Residuals and derivatives of one block at one state; see the module."""

    residual: Array
    shared: Array
    pose: Array


class Block(Protocol):
    """A kind of observation.  columns : of the shared unknowns it depends on, (S,)."""

    @property
    def columns(self) -> NDArray[np.intp]: ...

    def residual(self, state: State) -> Array:
        """Residuals (V, M) in the block's own unit, px or m."""
        ...

    def linear(self, state: State) -> Linear:
        """The same with derivatives."""
        ...
