"""Estimate mode of the poses: the trajectory of the pose graph."""

from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import read_table
from card.geometry import Trajectory
from card.poses.finish import WORLD_UP, Source, write_poses


def take_refined(*, refined: Path, **stage: Any) -> None:
    """Write the refined trajectory as the poses of the sequence, by the checks that an imported one passes.

    refined : artifact of schema ``trajectory``, in world; `stage` as `write_poses` takes them.
    """
    path = Trajectory.from_table(read_table(refined, "trajectory"))
    write_poses(Source(refined, path.t_ns, path.at(path.t_ns), np.eye(4), WORLD_UP), **stage)
