# The checked configuration, the sequences to build, settings and code of a stage, what a run says.
import os
from pathlib import Path

from card.artifacts.code import code_hash
from card.artifacts.documents import read_yaml
from card.artifacts.schemas import check, load_schema, with_defaults
from card.errors import CardError
from card.packaging.summary import summarize
from card.recording.description import check_identity
from card.recording.fingerprint import fingerprint
from card.recording.sheet import read_sequences
from card.recording.space import require_space

BASE = Path(workflow.basedir)
SETTINGS = with_defaults(config, load_schema("config"))
RAW = SETTINGS["recordings"]
CAMERAS = ("camera_left", "camera_right")
LIDARS = ("lidar_front", "lidar_rear")


def load_plan():
    """The checked configuration: licences, gates and the sequences to build, by id."""
    check(SETTINGS, "config", "config/config.yaml")
    licenses = read_yaml(Path(SETTINGS["licenses"]), "licenses")
    gates = read_yaml(Path(SETTINGS["gates"]), "gates")
    rows = read_sequences(Path(SETTINGS["sheet"]), licenses["countries"])
    wanted = [name for name in str(SETTINGS["sequences"]).split(",") if name]
    unknown = sorted(set(wanted) - {row.id for row in rows})
    if unknown:
        raise CardError(
            "unknown sequence", where="--config sequences", found=unknown[0]
        )
    chosen = {
        row.id: row
        for row in rows
        if not row.quarantine and (not wanted or row.id in wanted)
    }
    for row in chosen.values():
        check_raw_input(row)
    return licenses, gates, chosen


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
    if row.session and row.session not in simulated["sessions"]:
        folder = Path(RAW, "sessions")
        if not (folder / row.session).is_dir():
            there = (
                sorted(path.name for path in folder.glob("*")) + simulated["sessions"]
            )
            raise CardError(
                "unknown session",
                where=row.id,
                found=row.session,
                wanted=f"one of {there}",
            )


try:
    LICENSES, GATES, SEQUENCES = load_plan()
except CardError as error:
    raise WorkflowError(f"card: {error}") from None


wildcard_constraints:
    id="[a-z0-9_-]+",
    session="[0-9]{4}-[0-9]{2}-[0-9]{2}-(start|mid|end)",
    day="[0-9]{4}-[0-9]{2}-[0-9]{2}",


def code(stage):
    """Hash of a stage's script and of all library code behind it."""
    return code_hash(BASE / "workflow" / "scripts" / f"{stage}.py")


def cfg(stage, *names):
    """Settings (all, or the named ones) and gates of a stage, as one dict of builtins."""
    scale = SETTINGS["scale"]
    settings = {name: SETTINGS[stage][name] for name in names or SETTINGS[stage]}
    gates = [
        {
            **{name: gate[name] for name in ("figure", "unit", "better")},
            "threshold": gate["threshold"][scale],
        }
        for gate in GATES
        if gate["stage"] == stage and scale in gate["threshold"]
    ]
    return {"settings": settings, "gates": gates}


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
    print(summarize(Path("results", "release")))


def print_failure():
    print(
        "card: not everything could be built; the lines that begin with 'card:' say why. Mend the input, or give the"
        f" sequence a reason under quarantine in {SETTINGS['sheet']}, and run again: what is done is kept."
    )


def warn_lost_records():
    """Without its records the workflow does not see changed settings; say so rather than keep stale results."""
    if Path("results").is_dir() and not Path(".snakemake", "metadata").is_dir():
        print(
            "card: the records of earlier runs are gone: settings changed since then go unseen; --forceall rebuilds"
        )
