"""The tables agree with each other, with `release.json` and with the shards."""

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

from card.packaging.checks.contents import Contents, Row
from card.packaging.checks.jpeg import jpeg_problems
from card.packaging.modalities import LIDARS
from card.packaging.retractions import remains

PAIR_NS = 1_000_000
"""Right images pair within 1 ms, whatever a team's ingest was told."""
PER_FRAME = ("camera_left", "camera_right", "ground_truth", "labels")


def check_tables(contents: Contents) -> Iterator[str]:
    """Ids, numbers, times and counts across all tables."""
    yield from _check_frames(contents)
    yield from _check_sequences(contents)
    yield from _check_release(contents)
    yield from _check_mini(contents)
    yield from _check_retractions(contents)


def _check_frames(contents: Contents) -> Iterator[str]:
    for split, rows in contents.frames.items():
        for row in rows:
            if row["split"] != split:
                yield f"metadata/frames-{split}.parquet: {_name(row)} says split {row['split']}"
    frames = sorted(contents.all_frames(), key=lambda row: (row["sequence"], row["frame"]))
    known = {row["sequence"] for row in contents.sequences}
    packed = {(row["modality"], row["sequence"], row["frame"], row["burst"]) for row in contents.members}
    for before, after in pairwise(frames):
        if before["sequence"] != after["sequence"]:
            continue
        if before["frame"] == after["frame"]:
            yield f"metadata/frames: {_name(after)} is there twice ({before['split']}, {after['split']})"
        elif before["t_ns"] >= after["t_ns"]:
            yield f"metadata/frames: time of {_name(after)} does not increase"
    for row in frames:
        if row["sequence"] not in known:
            yield f"metadata/frames: {_name(row)} belongs to no sequence of metadata/sequences.parquet"
        if row["right_t_ns"] is not None and abs(row["right_t_ns"] - row["t_ns"]) > PAIR_NS:
            yield f"metadata/frames: {_name(row)} has a right image of another time"
        if row["has_camera_right"] and row["right_t_ns"] is None:
            yield f"metadata/frames: {_name(row)} has a right image without a time"
        for modality in PER_FRAME:
            if row[f"has_{modality}"] != ((modality, row["sequence"], row["frame"], None) in packed):
                yield f"metadata/frames: {_name(row)} has_{modality} contradicts the member table"
        for lidar in LIDARS:
            burst = row[f"{lidar}_burst"]
            there = burst is not None and (lidar, row["sequence"], None, burst) in packed
            if row[f"has_{lidar}"] != there:
                yield f"metadata/frames: {_name(row)} has_{lidar} contradicts the member table"
        if row["has_labels"] == (row["label_state"] == "not_reviewed"):
            yield f"metadata/frames: {_name(row)} has_labels contradicts its label_state {row['label_state']}"
    numbered = {(row["sequence"], row["frame"]) for row in frames}
    for row in contents.members:
        if row["sequence"] not in known:
            yield f"metadata/members.parquet: {row['file']} belongs to no sequence"
        elif row["burst"] is None and (row["sequence"], row["frame"]) not in numbered:
            yield f"metadata/members.parquet: {row['file']} belongs to no frame"


def _check_sequences(contents: Contents) -> Iterator[str]:
    frames = contents.all_frames()
    counts: dict[str, Counter[str]] = {row["sequence"]: Counter() for row in contents.sequences}
    for frame in frames:
        counts.setdefault(frame["sequence"], Counter()).update(
            frames=1,
            reviewed_frames=int(frame["label_state"] != "not_reviewed"),
            boxes_positive=frame["boxes_positive"],
            boxes_negative=frame["boxes_negative"],
        )
    packed: dict[str, set[str]] = {}
    for member in contents.members:
        counts.setdefault(member["sequence"], Counter()).update(files=1, bytes=member["size"])
        packed.setdefault(member["sequence"], set()).add(member["modality"])
    for row in contents.sequences:
        where = f"metadata/sequences.parquet: {row['sequence']}"
        for name in ("frames", "reviewed_frames", "boxes_positive", "boxes_negative", "files", "bytes"):
            if row[name] != counts[row["sequence"]][name]:
                yield f"{where} states {row[name]} {name}, found {counts[row['sequence']][name]}"
        modalities = packed.get(row["sequence"], set())
        if set(filter(None, row["modalities"].split(","))) != modalities:
            yield f"{where} states modalities {row['modalities']}, found {','.join(sorted(modalities))}"
        if row["t_end_ns"] < row["t_start_ns"]:
            yield f"{where} ends before it starts"
    by_id = {row["sequence"]: row for row in contents.sequences}
    for frame in frames:
        row = by_id.get(frame["sequence"], frame)
        for name in ("country", "place", "road_type", "light", "off_road", "session"):
            if frame[name] != row[name]:
                yield f"metadata/frames: {_name(frame)} has another {name} than its sequence"


def _check_release(contents: Contents) -> Iterator[str]:
    release = contents.release
    if release is None:
        return
    changelog = contents.tree / "CHANGELOG.md"
    if (
        changelog.is_file()
        and f"## {release['version']}" not in changelog.read_text(encoding="utf-8").splitlines()
    ):
        yield f"CHANGELOG.md: no entry for version {release['version']}"
    if contents.changes is not None and contents.changes["to"] != release["version"]:
        yield f"changes.json: is about version {contents.changes['to']}, the release is {release['version']}"
    ids = [row["sequence"] for row in contents.sequences]
    if release["sequences"] != ids or len(set(ids)) != len(ids):
        yield "release.json: sequences are not those of metadata/sequences.parquet"
    for split, rows in contents.frames.items():
        if release["frames"][split] != len(rows):
            yield f"release.json: states {release['frames'][split]} {split} frames, found {len(rows)}"
    if (release["files"], release["bytes"]) != (
        len(contents.members),
        sum(r["size"] for r in contents.members),
    ):
        yield "release.json: files or bytes are not those of metadata/members.parquet"


def _check_retractions(contents: Contents) -> Iterator[str]:
    sequences = [row["sequence"] for row in contents.sequences]
    for name in remains(contents.retractions, contents.members, sequences):
        yield f"metadata/retractions.parquet: {name} is retracted but there"
    gone = {
        (row["sequence"], row["frame"]) for row in contents.retractions if row["modality"] == "camera_left"
    }
    gone -= {(row["sequence"], row["frame"]) for row in contents.retractions if row["region"]}
    for row in [*contents.all_frames(), *contents.mini]:
        if (row["sequence"], row["frame"]) in gone:
            yield f"metadata/retractions.parquet: {_name(row)} is retracted but has a row"


def _check_mini(contents: Contents) -> Iterator[str]:
    splits = {(row["sequence"], row["frame"]): row["split"] for row in contents.all_frames()}
    for row in contents.mini:
        split = splits.get((row["sequence"], row["frame"]))
        if split is None:
            yield f"mini/mini.parquet: {_name(row)} is no frame of the tree"
        elif split != row["split"]:
            yield f"mini/mini.parquet: {_name(row)} has another split than its frame"
        for problem in jpeg_problems(row["image"]):
            yield f"mini/mini.parquet: {_name(row)} {problem}"


def _name(row: Row) -> str:
    return f"{row['sequence']} frame {row['frame']}"
