"""The command `card evaluate`."""

import argparse
from pathlib import Path
from typing import Any

from card.errors import CardError


def add(commands: Any) -> None:
    """Add the command to the parsers of `card`."""
    parser = commands.add_parser("evaluate", help="score a method's predictions on a release")
    parser.add_argument("--release", type=Path, required=True, help="tree of the release")
    parser.add_argument(
        "--predictions",
        type=Path,
        required=True,
        help="<sequence>/<frame:06d>.{npz,npy,png,exr}; <sequence>.txt for odometry",
    )
    parser.add_argument("--task", choices=("depth", "completion", "odometry"), default="depth")
    parser.add_argument("--split", help="test, or zero_shot for odometry, if left out")
    parser.add_argument("--method", help="name of the method; that of the folder if left out")
    parser.add_argument("--space", choices=("original", "undistorted", "rectified"), default="original")
    parser.add_argument("--unit", type=float, metavar="METRES", help="what 1 in a file means, e.g. 0.001")
    parser.add_argument("--profile", choices=("default", "paper", "pooled"))
    parser.add_argument("--settings", type=Path, help="YAML with settings of the benchmark")
    parser.add_argument("--out", type=Path, help="folder to make; evaluation-<method> if left out")
    parser.set_defaults(run=_evaluate)


def _evaluate(options: argparse.Namespace) -> None:
    from card.artifacts import default_settings, load_schema, read_yaml
    from card.artifacts.schemas import with_defaults
    from card.benchmark.evaluate import evaluate
    from card.benchmark.frames import Method
    from card.benchmark.odometry import evaluate_odometry

    name = options.method or options.predictions.resolve().name
    out = options.out or Path(f"evaluation-{name}")
    if out.exists() and any(out.iterdir()) and not (out / "table.md").is_file():
        raise CardError("folder holds something else than an evaluation", where=out, wanted="another --out")
    settings = default_settings("benchmark")
    if options.settings:
        given = read_yaml(options.settings, "settings/benchmark")
        settings = with_defaults(given, load_schema("settings/benchmark"))
    if options.profile:
        settings["profile"] = options.profile
    report = out.with_name(f"{out.name}.report.json")
    if options.task == "odometry":
        evaluate_odometry(
            release=options.release,
            split=options.split or "zero_shot",
            method=name,
            predictions=options.predictions,
            out=out,
            report=report,
            settings=settings,
        )
    else:
        evaluate(
            release=options.release,
            split=options.split or "test",
            method=Method(name, options.predictions, options.space, options.unit),
            task=options.task,
            out=out,
            report=report,
            settings=settings,
        )
    print((out / "table.md").read_text(encoding="utf-8"))
