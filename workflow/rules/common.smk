# The checked configuration, the sequences to build, settings and code of a stage, what a run says.
import os
import sys
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

from card.annotations.loop.sample import read_sample
from card.artifacts.code import code_hash
from card.artifacts.documents import read_yaml
from card.artifacts.schemas import check, load_schema, schema_folder, with_defaults
from card.errors import CardError
from card.packaging.batches import batch_repository, read_batches
from card.packaging.licenses import license_of, read_licenses
from card.packaging.reviews import read_reviews
from card.packaging.summary import summarize
from card.packaging.takedowns import read_takedowns, whole_sequences
from card.packaging.versions import latest_records
from card.recording.description import check_identity
from card.recording.fingerprint import fingerprint
from card.recording.nearest_session import nearest_session, start_of
from card.recording.sheet import read_sequences
from card.recording.space import require_space
from card.splits.history import check_kept
from card.splits.ledger import COLUMNS, read_ledger

BASE = Path(workflow.basedir)
SETTINGS = with_defaults(config, load_schema("config"))
RAW = SETTINGS["recordings"]
SUBSET = [name for name in str(SETTINGS["sequences"]).split(",") if name]
# Part of a release is no release: it must not take the place of the whole one.
RELEASE = "results/release-subset" if SUBSET else "results/release"
CAMERAS = ("camera_left", "camera_right")
LIDARS = ("lidar_front", "lidar_rear")
# What an evaluation depends on; not on which methods there are.
PROTOCOL = [name for name in SETTINGS["benchmark"] if name not in ("methods", "split")]
# Scripts inherit it: sums of linear algebra on another number of cores would have other last digits.
os.environ.update(OPENBLAS_NUM_THREADS="1")


def load_plan():
    """The checked configuration: licences, gates, splits ledger, takedowns, all rows, those to build by id."""
    check(SETTINGS, "config", "config/config.yaml")
    licenses = read_licenses(Path(SETTINGS["licenses"]))
    gates = read_yaml(Path(SETTINGS["gates"]), "gates")
    rows = read_sequences(Path(SETTINGS["sheet"]), licenses["countries"])
    takedowns = read_takedowns(Path(SETTINGS["takedowns"]), [row.id for row in rows])
    withdrawn = whole_sequences(takedowns)
    unknown = sorted(set(SUBSET) - {row.id for row in rows})
    if unknown:
        raise CardError(
            "unknown sequence", where="--config sequences", found=unknown[0]
        )
    chosen = {
        row.id: row
        for row in rows
        if not row.quarantine
        and row.id not in withdrawn
        and (not SUBSET or row.id in SUBSET)
    }
    for name, row in chosen.items():
        check_raw_input(row)
        chosen[name] = with_session(row)
        check_session(chosen[name])
    check_kept(Path(SETTINGS["splits_ledger"]))
    ledger = [
        dict(zip(COLUMNS, line.cells()))
        for line in read_ledger(Path(SETTINGS["splits_ledger"]))
    ]
    return licenses, gates, ledger, takedowns, rows, chosen


def check_records():
    """Without its records of earlier runs the workflow cannot see what changed: refuse to build on results."""
    records = Path(".snakemake", "metadata")
    if {"--touch", "--forceall", "-F"} & set(sys.argv) or not list(
        Path("results").glob("*/*.report.json")
    ):
        return
    if not records.is_dir() or not any(records.iterdir()):
        raise CardError(
            "results are there but not the records of how they were made",
            where=".snakemake",
            wanted="the folder back; or --touch, if nothing changed since; or --forceall",
        )


def check_raw_input(row):
    """A recorded drive and its session must be there before anything starts."""
    simulated = SETTINGS["simulation"]
    if (
        row.id not in simulated["drives"]
        and not Path(row.recording, "recording.yaml").is_file()
    ):
        raise CardError(
            "recording is missing",
            where=row.id,
            wanted=f"{row.recording}/recording.yaml",
        )
    if Path(row.recording, "recording.yaml").is_file():
        check_identity(Path(row.recording), row)


try:
    check_records()
    LICENSES, GATES, LEDGER, TAKEDOWNS, ROWS, SEQUENCES = load_plan()
    BATCHES = read_batches(Path(SETTINGS["batches_ledger"]))
    REVIEWS = read_reviews(
        Path(SETTINGS["ground_truth_reviews"]), {row.id for row in ROWS}, SEQUENCES
    )
except CardError as error:
    raise WorkflowError(f"card: {error}") from None


wildcard_constraints:
    id="[a-z0-9_-]+",
    session="[0-9]{4}-[0-9]{2}-[0-9]{2}-(start|mid|end|leica)",
    day="[0-9]{4}-[0-9]{2}-[0-9]{2}",


def code(stage):
    """Hash of a stage's script and of all library code behind it."""
    return code_hash(BASE / "workflow" / "scripts" / f"{stage}.py")


def cfg(stage, *names):
    """Settings (all, or the named ones) and gates of a stage, as one dict of builtins."""
    settings = {name: SETTINGS[stage][name] for name in names or SETTINGS[stage]}
    return {"settings": settings, "gates": gates_of(stage)}


def gates_of(stage):
    """Gates of a stage at the configured scale."""
    return [
        {
            **{name: gate[name] for name in ("figure", "unit", "better")},
            "threshold": gate["threshold"][SETTINGS["scale"]],
        }
        for gate in GATES
        if gate["stage"] == stage
    ]


def check_space():
    """Stop before the start where the disk cannot hold what is still to be made."""
    missing = [
        name
        for name in SIMULATED["drives"]
        if name in SEQUENCES and not Path(RAW, name).is_dir()
    ]
    folders = [
        Path(sequence.recording)
        for name, sequence in SEQUENCES.items()
        if not is_packed(name)
    ]
    try:
        require_space(Path("."), folders, len(missing), SETTINGS["scale"])
    except CardError as error:
        raise WorkflowError(f"card: {error}") from None


def print_summary():
    """What a run ends with: sequences, frames, files, bytes, gates, and where to look."""
    print(summarize(Path(RELEASE)))


def print_failure():
    print(
        "card: not everything could be built; the lines that begin with 'card:' say why. Mend the input, or give the"
        f" sequence a reason under quarantine in {SETTINGS['sheet']}, and run again: what is done is kept."
    )
