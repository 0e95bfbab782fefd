"""The ground truth at the size of a real drive with estimated poses and a delivered calibration.

    python benchmarks/field_end_to_end.py de_town_bumps-1-45s

runs the poses stage on the named drives (drive, seed and seconds) and prints what is left of the accuracy.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

from field import OUT, field_drive
from field_ground_truth import WORK, inputs_of
from field_wheels import estimated
from ground_truth_figures import Measured
from mesh_truth import Mesh

FIGURES = ("surface_median_mm", "surface_p95_mm", "occluded_pct", "points_per_frame")


def main() -> None:
    """Measure the drives that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drives", nargs="+", help="<drive>-<seed>-<seconds>s")
    parser.add_argument("--frames", type=int, default=2, help="frames a drive that meet the mesh")
    parser.add_argument("--out", type=Path, default=OUT, help="where simulated drives are")
    parser.add_argument("--work", type=Path, default=WORK, help="where results go")
    options = parser.parse_args()
    for name in options.drives:
        drive, seed, seconds = name.rsplit("-", 2)
        field = field_drive(drive, int(seed), float(seconds.removesuffix("s")), options.out)
        folder = options.work / name
        inputs = replace(inputs_of(field, folder), calibration=field.delivered)
        inputs = replace(inputs, trajectory=estimated(field, inputs, folder / "estimated"))
        built = Measured(inputs)
        figures = built.frame_figures(Mesh(field.truth / "world.npz"), options.frames)
        figures = {figure: figures[figure] for figure in FIGURES} | built.static_figures(dufomap=False)
        (folder / "end_to_end.json").write_text(json.dumps(figures, indent=1))
        print(name, {figure: round(value, 3) for figure, value in figures.items()}, flush=True)


if __name__ == "__main__":
    main()
