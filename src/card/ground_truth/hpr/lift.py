"""Hidden-point removal as a lower convex hull over the image plane.

Katz, Tal and Basri, "Direct Visibility of Point Sets", SIGGRAPH 2007, flip a point p at range n = |p| to
p' = p (2R - n) / n; the viewer at the origin sees p if p' is a vertex of the convex hull of all p' and the
origin. Let every point lie in front of the viewer, z > 0, and put u = x/z, v = y/z, g = sqrt(1 + u^2 + v^2),
so that n = g z. The projective map (x, y, z) -> (x/z, y/z, 2R/z) takes p' to (u, v, W) with

    W = g / (1 - n / 2R),

keeps straight lines, and moves the origin to infinity on the W axis. So p is visible exactly if (u, v, W) is
a vertex of the lower convex hull of all (u, v, W). W differs little from g, which is strictly convex: what
hides a point lies near it in the image.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from card.ground_truth.compiled import compiled

#: Columns of a lifted point: u, v, W and the range n in metres.
COLUMNS = 4


@compiled
def lift(points: Any, index: Any, diameter: float, lifted: Any) -> None:
    """Write u, v, W, n of points[index] to `lifted` (M, 4), for a sphere of diameter 2R, metres."""
    for i in range(index.size):
        k = index[i]
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        n = np.sqrt(x * x + y * y + z * z)
        lifted[i, 0] = x / z
        lifted[i, 1] = y / z
        lifted[i, 2] = n / z * (diameter / (diameter - n))
        lifted[i, 3] = n
