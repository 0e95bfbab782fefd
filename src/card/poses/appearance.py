"""Returns to a place known by its look from above, however far the odometry has drifted meanwhile."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import apply, inverse
from card.poses.loops import spaced, travelled

Array = NDArray[np.float64]
#: The points (M, 3) of a node's sweep, in the rig.
Points = Callable[[int], Array]


def returns(poses: Array, points: Points, settings: Mapping[str, Any]) -> list[tuple[int, int, Array]]:
    """Pairs (earlier, later) of nodes of poses (N, 4, 4), and the later one's pose (4, 4) in the earlier one.

    The drive is cut into pieces of `appearance_map_m`, whose points are compared as densities on the ground:
    S. Gupta et al., "Effectively Detecting Loop Closures using Point Cloud Density Maps", ICRA 2024. They
    must have `appearance_inliers` features in common. A pair is a guess, to be proved by registration.

    Raises
    ------
    CardError
        If the package map-closures is not installed.
    """
    try:
        from map_closures.map_closures import MapClosures
    except ImportError as error:
        raise CardError(
            "loops by appearance without the package map-closures",
            where="pose_graph.appearance",
            found=str(error),
            wanted="map-closures 2.2",
        ) from error
    way = travelled(poses)
    sweeps = spaced(way, settings["loop_map_spacing_m"])
    piece = np.floor(way[sweeps] / settings["appearance_map_m"]).astype(int)
    finder = MapClosures()
    middles: list[int] = []
    pairs = []
    for number, own in enumerate(np.split(sweeps, np.flatnonzero(np.diff(piece)) + 1)):
        middle = int(own[len(own) // 2])
        middles.append(middle)
        local = [apply(inverse(poses[middle]) @ poses[k], points(int(k))) for k in own]
        closure = finder.get_best_closure(number, np.concatenate(local))
        earlier = middles[closure.source_id] if closure.source_id < number else middle
        far = way[middle] - way[earlier] >= settings["loop_min_way_m"]
        if far and closure.number_of_inliers >= settings["appearance_inliers"]:
            pairs.append((earlier, middle, inverse(np.asarray(closure.pose))))
    return pairs
