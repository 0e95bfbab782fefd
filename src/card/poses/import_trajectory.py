"""Import mode of the poses: the trajectory of another system."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import read_json
from card.geometry import from_json
from card.poses.anchor import up_vector
from card.poses.delivered import read_kitti, read_tum
from card.poses.finish import Source, write_poses


def import_trajectory(
    *, delivered: Path, calibration: Path, settings: Mapping[str, Any], **stage: Any
) -> None:
    """Read the trajectory a recording was delivered with and write it as the poses of the sequence.

    Parameters
    ----------
    delivered : trajectory file in the format that the settings name; the times of a KITTI one lie beside it.
    stage : as `write_poses` takes them.

    Raises
    ------
    CardError
        For a file that cannot be read; also as `write_poses`.
    """
    t_ns, delivered_from_sensor = _read(delivered, settings)
    rig_from_sensor = _rig_from_sensor(calibration, settings["frame"])
    source = Source(delivered, t_ns, delivered_from_sensor, rig_from_sensor, up_vector(settings["up_axis"]))
    write_poses(source, calibration=calibration, settings=settings, **stage)


def _read(delivered: Path, settings: Mapping[str, Any]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    if settings["format"] == "tum":
        return read_tum(delivered, settings["max_rotation_error"])
    return read_kitti(delivered, delivered.with_name(settings["times_file"]), settings["max_rotation_error"])


def _rig_from_sensor(calibration: Path, frame: str) -> NDArray[np.float64]:
    if frame == "rig":
        return np.eye(4)
    return from_json(read_json(calibration, "calibration")["extrinsics"][f"rig_from_{frame}"])
