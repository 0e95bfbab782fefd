"""The drawing of the simulated car: what a team knows of it before any calibration."""

from pathlib import Path
from typing import Any

from card.artifacts import write_json
from card.geometry import to_json
from card.simulation.rig import BUILT_M, BUILT_RAD, WHEELS, nominal_rig
from card.simulation.scales import scale_named


def write_drawing(path: Path, scale: str) -> None:
    """Write the drawing (schema ``drawing``) of the car with the cameras of a scale."""
    write_json(path, drawing(scale), "drawing")


def drawing(scale: str) -> dict[str, Any]:
    """The document of `write_drawing`: it is the same for every car and every day."""
    size = scale_named(scale)
    rig = nominal_rig(size.width, size.height)
    undistorted = rig.cameras["camera_left"].undistorted().to_json()
    return {
        "schema": "drawing",
        "cameras": {name: camera.to_json() for name, camera in rig.cameras.items()},
        "camera_left_undistorted": {k: undistorted[k] for k in ("width", "height", "fx", "fy", "cx", "cy")},
        "extrinsics": {
            f"rig_from_{name}": {**to_json(pose), "sigma_m": BUILT_M, "sigma_rad": BUILT_RAD}
            for name, pose in rig.rig_from.items()
        },
        "wheels": {
            wheel: {
                "center_m": rig.wheel_center_m[wheel].tolist(),
                "contact_m": rig.wheel_contact_m[wheel].tolist(),
                "sigma_m": BUILT_M,
            }
            for wheel in WHEELS
        },
    }
