"""How much of a drive is simulated: the same code from a test in seconds to a day's drive."""

from dataclasses import dataclass, replace

from card.errors import CardError


@dataclass(frozen=True)
class Scale:
    """Sizes and durations of one scale.

    width, height : image size, px.
    columns : firings of all 32 channels a LiDAR revolution.
    duration_s : time LiDARs and IMU run.
    camera_start_s, camera_duration_s : the cameras' excerpt; they run at 10 Hz.
    board_views : poses of the board in a calibration session.
    session_s : time LiDARs and IMU run in a session's drive, whose round takes half a minute.
    """

    name: str
    width: int
    height: int
    columns: int
    duration_s: float
    camera_start_s: float
    camera_duration_s: float
    board_views: int
    session_s: float

    def cut(self, duration_s: float) -> "Scale":
        """The same scale, nothing running longer than ``duration_s`` from the drive's start."""
        cameras = max(0.0, min(self.camera_duration_s, duration_s - self.camera_start_s))
        return replace(self, duration_s=min(self.duration_s, duration_s), camera_duration_s=cameras)


SCALES = {
    scale.name: scale
    for scale in (
        Scale("tiny", 140, 140, 90, 6.0, 2.0, 0.5, 3, 0.5),
        Scale("demo", 562, 563, 200, 45.0, 8.0, 5.0, 40, 8.0),
        Scale("full", 2248, 2252, 2000, 120.0, 5.0, 80.0, 500, 60.0),
    )
}


def scale_named(name: str) -> Scale:
    """The scale ``tiny``, ``demo`` or ``full``; CardError for another name."""
    if name not in SCALES:
        raise CardError("unknown scale", found=name, wanted=" or ".join(SCALES))
    return SCALES[name]
