"""Commands of the labelling loop: `card annotations choose | sample | export`."""

import argparse
from pathlib import Path
from typing import Any

FORMATS = ("yolo", "voc", "coco", "cvat", "label_studio")
WAYS = ("random", "grouped")


def add(commands: Any) -> None:
    """Add the command to the parser of the command line."""
    actions = commands.add_parser("annotations", help="the labelling loop").add_subparsers(
        required=True, metavar="ACTION"
    )
    choose = actions.add_parser("choose", help="list the frames that have boxes")
    choose.add_argument("list", type=Path)
    choose.set_defaults(run=_choose)

    sample = actions.add_parser("sample", help="draw the seed and its splits from a list of frames")
    sample.add_argument("list", type=Path)
    sample.set_defaults(run=_sample)

    export = actions.add_parser("export", help="write a folder for a label tool or for training")
    export.add_argument("out", type=Path)
    what = export.add_mutually_exclusive_group(required=True)
    what.add_argument("--part", choices=("seed", "rest"), help="of the sample, for a label tool")
    what.add_argument("--training", choices=WAYS, help="split of the seed, for training")
    export.add_argument("--format", choices=FORMATS, default="yolo", help="of the label tool")
    export.add_argument("--detector", choices=WAYS, default="random", help="whose proposals")
    export.set_defaults(run=_export)

    for parser in (choose, sample, export):
        parser.add_argument("--config", type=Path, default=Path("config/config.yaml"))
        parser.add_argument("--results", type=Path, default=Path("results"))


def _settings(options: argparse.Namespace) -> dict[str, Any]:
    from card.artifacts import load_schema, read_yaml
    from card.artifacts.schemas import with_defaults

    return with_defaults(read_yaml(options.config, "config"), load_schema("config"))


def _choose(options: argparse.Namespace) -> None:
    from card.annotations.loop.choose import labelled_frames, write_frames

    ids = sorted(path.parent.name for path in options.results.glob("*/label_states.parquet"))
    frames = labelled_frames(options.results, ids)
    write_frames(options.list, frames)
    print(f"{len(frames)} frames with boxes of {len(ids)} sequences in {options.list}")


def _sample(options: argparse.Namespace) -> None:
    from card.annotations.loop.choose import read_frames
    from card.annotations.loop.sample import SEED, SPLITS, draw_sample, split_figures, write_sample

    settings = _settings(options)["proposals"]
    sample = draw_sample(read_frames(options.list, options.results), settings)
    write_sample(Path(settings["sample"]), sample)
    seed = sum(row.part == SEED for row in sample)
    print(f"{seed} of {len(sample)} frames are the seed; drawn into {settings['sample']}")
    for way, figures in split_figures(sample, settings["near_frames"]).items():
        counts = ", ".join(
            f"{name} {figures[f'{name}_frames']} ({figures[f'{name}_sequences']} sequences)"
            for name in SPLITS
        )
        print(f"{way}: {counts}; {figures['near_pct']:.0f} % of the held-out frames are near a train frame")


def _export(options: argparse.Namespace) -> None:
    from card.annotations.loop.export import export_for_labelling, export_for_training
    from card.annotations.loop.sample import read_sample

    settings = _settings(options)
    common = {
        "results": options.results,
        "sample": read_sample(Path(settings["proposals"]["sample"])),
        "out": options.out,
        "annotations": settings["annotations"],
    }
    if options.training:
        counts = export_for_training(way=options.training, **common)
    else:
        counts = export_for_labelling(
            part=options.part,
            form=options.format,
            way=options.detector,
            proposals=settings["proposals"],
            **common,
        )
    print(f"{options.out}: " + ", ".join(f"{number} {name}" for name, number in counts.items()))
