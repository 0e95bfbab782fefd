"""A drive at the size of a real one, without images: what the accuracy of LiDAR stages is measured on.

    python benchmarks/field.py it_town_loop --seed 1 --seconds 75

simulates it under benchmarks/out/field/ and prints where; a drive that is there already is taken as it is.
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

from card.artifacts import atomic_folder, write_json
from card.simulation.calibrations import true_calibration
from card.simulation.deliveries import write_trajectory
from card.simulation.drives import drive_named
from card.simulation.record import write_sweeps
from card.simulation.scales import scale_named
from card.simulation.simulate import write_description, write_motion
from card.simulation.world import world_of

OUT = Path(__file__).resolve().parent / "out" / "field"


@dataclass(frozen=True)
class Field:
    """Folders of one drive, `recording` in the raw layout and `truth`, and its true calibration."""

    folder: Path

    @property
    def recording(self) -> Path:
        return self.folder / "recording"

    @property
    def truth(self) -> Path:
        return self.folder / "truth"

    @property
    def calibration(self) -> Path:
        return self.folder / "calibration.json"


def field_drive(drive: str, seed: int, seconds: float, out: Path = OUT, threads: int = 2) -> Field:
    """Simulate `seconds` of a drive at full scale: both LiDARs, IMU, delivered trajectory and truth."""
    folder = out / f"{drive}-{seed}-{seconds:g}s"
    if not folder.is_dir():
        size = replace(scale_named("full"), duration_s=seconds)
        world = world_of(drive, drive_named(drive), size, seed)
        with atomic_folder(folder) as partial:
            field = Field(partial)
            field.recording.mkdir()
            field.truth.mkdir()
            path = write_motion(world, field.recording, field.truth)
            write_sweeps(world, field.recording, field.truth, threads)
            write_description(world, field.recording, cameras=())
            write_trajectory(field.recording, path, seed)
            write_json(field.calibration, true_calibration(world.drive.session, seed, "full"), "calibration")
    return Field(folder)


def main() -> None:
    """Simulate the drive that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drive")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    print(field_drive(options.drive, options.seed, options.seconds, options.out).folder)


if __name__ == "__main__":
    main()
