"""The wheel artifacts in the form in which they are written."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.geometry import Trajectory, apply, inverse, quaternion_from_matrix
from card.wheels.road_plane import RoadPlanes, fit_road_planes
from card.wheels.wheel_fit import Excitation

Array = NDArray[np.float64]
#: A micrometre, and a nanoradian for the quaternion: no reader needs more.
POSITION_DECIMALS, QUATERNION_DECIMALS = 6, 9


def excitation_document(wheels: Mapping[str, Excitation], trajectory: Trajectory) -> dict[str, Any]:
    """The document of schema ``wheel_excitation``."""
    # Whole numbers and others in a row: numpy makes the objects faster than a loop over the rows.
    rows = np.empty((len(trajectory.t_ns), 8), dtype=object)
    rows[:, 4:] = np.round(trajectory.rotation_wxyz, QUATERNION_DECIMALS)
    document: dict[str, Any] = {}
    for name, wheel in wheels.items():
        rows[:, 0], rows[:, 1:4] = wheel.t_ns, np.round(wheel.position, POSITION_DECIMALS)
        residual = np.round(wheel.residual_m, POSITION_DECIMALS).astype(object)
        residual[np.isnan(wheel.residual_m)] = None
        document[name] = {
            "samples": rows.tolist(),
            "points": wheel.points.tolist(),
            "residual_m": residual.tolist(),
            "std_m": np.round(wheel.std_m, POSITION_DECIMALS).tolist(),
            "gap": wheel.gap.tolist(),
            "uncertain": wheel.uncertain.tolist(),
        }
    return {"schema": "wheel_excitation", "wheels": document}


def frame_planes(
    wheels: Mapping[str, Excitation], trajectory: Trajectory, t_ns: NDArray[np.int64]
) -> tuple[RoadPlanes, Array]:
    """The road planes at frame times (F,) and the root mean square of their contacts' standard deviations
    (F,), metres; infinite where one is in a gap."""
    found = [wheel.at(t_ns) for wheel in wheels.values()]
    rig_from_world = inverse(trajectory.at(t_ns))
    contacts = np.stack([apply(rig_from_world, position) for position, _ in found], axis=1)
    std = np.sqrt(np.mean([std**2 for _, std in found], axis=0))
    return fit_road_planes(contacts), std


def plane_columns(
    frame: NDArray[np.int32], t_ns: NDArray[np.int64], planes: RoadPlanes, valid: NDArray[np.bool_]
) -> dict[str, NDArray[Any]]:
    """The columns of schema ``road_planes``, each (F,)."""
    road_from_rig = planes.road_from_rig()
    quaternion = quaternion_from_matrix(road_from_rig[:, :3, :3])
    return {
        "frame": frame,
        "t_ns": t_ns,
        **{f"normal_{axis}": planes.normal[:, i] for i, axis in enumerate("xyz")},
        "offset_m": planes.offset_m,
        "residual_m": planes.residual_m,
        "valid": valid,
        **{axis: road_from_rig[:, i, 3] for i, axis in enumerate("xyz")},
        **{f"q{axis}": quaternion[:, i] for i, axis in enumerate("wxyz")},
    }
