"""Measure the house.

    python benchmarks/run.py accuracy --scale demo --seed 1     against the simulator's truth
    python benchmarks/run.py bench                              what it costs

Both print one table and write its rows under benchmarks/out/. A module of accuracy/ or speed/ holds the rows
of its stage.
"""

import argparse
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

from rows import Row, publish
from work import prepare

HERE = Path(__file__).resolve().parent
OUT = HERE / "out"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the two measurements; 1 if a part of it failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    accuracy = commands.add_parser(
        "accuracy", help="build a release of simulated drives and compare to truth"
    )
    accuracy.add_argument("--scale", choices=("tiny", "demo", "full"), default="demo")
    accuracy.add_argument("--seed", type=int, default=1, help="any seed makes a new world")
    accuracy.add_argument("--cores", type=int, default=2)
    bench = commands.add_parser("bench", help="CPU time of the stages")
    bench.add_argument("--repeats", type=int, default=3, help="runs whose median counts")
    options = parser.parse_args(arguments)
    if options.command == "accuracy":
        return run_accuracy(options.scale, options.seed, options.cores)
    return run_bench(options.repeats)


def run_accuracy(scale: str, seed: int, cores: int) -> int:
    """Build a release in a work folder of its own and compare its artifacts to the truth.

    A release that fails its gates is still measured.
    """
    work = prepare(OUT / "work" / f"{scale}-{seed}", scale, seed)
    built = work.release(cores)
    rows, complete = collect(
        "accuracy", lambda module: module.rows(work.folder, work.truth, work.sequences())
    )
    publish(rows, OUT / f"accuracy-{scale}-{seed}.json")
    return 0 if built and complete else 1


def run_bench(repeats: int) -> int:
    """Time the stages, each against its baseline in the same run."""

    def measure(module: ModuleType) -> list[Row]:
        with tempfile.TemporaryDirectory(prefix="card-bench-") as scratch:
            return module.rows(Path(scratch), repeats)  # type: ignore[no-any-return]

    rows, complete = collect("speed", measure)
    publish(rows, OUT / "bench.json")
    return 0 if complete else 1


def collect(kind: str, measure: Callable[[ModuleType], list[Row]]) -> tuple[list[Row], bool]:
    """Rows of all modules of a kind, and whether every module could measure."""
    rows: list[Row] = []
    complete = True
    for path in sorted((HERE / kind).glob("*.py")):
        try:
            rows += measure(import_module(f"{kind}.{path.stem}"))
        except Exception:
            # One stage that cannot be measured must not hide the others.
            print(f"{path.relative_to(HERE)} could not measure:", file=sys.stderr)
            traceback.print_exc()
            complete = False
    return rows, complete


if __name__ == "__main__":
    sys.exit(main())
