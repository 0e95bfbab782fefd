"""The ground truth at the size of a real drive with nothing true: estimated poses, estimated calibration.

    python benchmarks/field_end_to_end.py de_town_bumps-1-45s de_town_bumps-2-45s

calibrates the session of each named drive (drive, seed and seconds), estimates its poses with that, and
prints what is left of the accuracy, and of each figure the median and the 95th percentile over the seeds of a
drive. What was measured before is not measured again.
"""

import argparse
import json
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from field import OUT, Field, field_drive
from field_ground_truth import WORK, inputs_of, show_medians
from field_wheels import estimated
from ground_truth_figures import Measured
from mesh_truth import Mesh
from session_bundle import OUT as SESSIONS
from session_bundle import bundle_at

from card.simulation.drives import drive_named

FIGURES = ("surface_median_mm", "surface_p95_mm", "occluded_pct", "points_per_frame")


def measured(field: Field, calibration: Path, folder: Path, frames: int) -> dict[str, float]:
    """Figures of one drive with a calibration and the poses found with it; kept in `folder`."""
    kept = folder / "end_to_end.json"
    if not kept.is_file():
        inputs = replace(inputs_of(field, folder), calibration=calibration)
        inputs = replace(inputs, trajectory=estimated(field, inputs, folder / "estimated"))
        built = Measured(inputs)
        figures = built.frame_figures(Mesh(field.truth / "world.npz"), frames)
        figures = {name: figures[name] for name in FIGURES} | built.static_figures(dufomap=False)
        kept.write_text(json.dumps(figures, indent=1))
    return dict(json.loads(kept.read_text()))


def main() -> None:
    """Measure the drives that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+", help="<drive>-<seed>-<seconds>s")
    parser.add_argument("--frames", type=int, default=2, help="frames a drive that meet the mesh")
    parser.add_argument("--out", type=Path, default=OUT, help="where simulated drives are")
    parser.add_argument("--sessions", type=Path, default=SESSIONS, help="where calibration sessions are")
    parser.add_argument("--work", type=Path, default=WORK, help="where results go, and are taken from")
    options = parser.parse_args()
    found: dict[str, list[dict[str, float]]] = defaultdict(list)
    for name in options.drives:
        drive, seed, seconds = name.rsplit("-", 2)
        field = field_drive(drive, int(seed), float(seconds.removesuffix("s")), options.out)
        calibration = bundle_at(drive_named(drive).session, int(seed), options.sessions)
        figures = measured(field, calibration, options.work / name, options.frames)
        print(name, {figure: round(value, 3) for figure, value in figures.items()}, flush=True)
        found[drive].append(figures)
    show_medians(found)


if __name__ == "__main__":
    main()
