"""Faults that a release tree may have, each with the finding that has to name it."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from packaging_faults import (
    MEMBERS,
    Corruption,
    behind,
    cell,
    copy,
    field,
    first_twice,
    flip,
    hidden_before,
    label,
    member,
    remove,
    rows,
    text,
    with_exif,
    write,
)

LEDGER = [
    {
        "sequence": "de_test",
        "first_frame": "0",
        "last_frame": "-",
        "split": "train",
        "stratum": "s",
        "group": "g",
    }
]
TRAIN, UNASSIGNED = "metadata/frames-train.parquet", "metadata/frames-unassigned.parquet"
SEQUENCES = "metadata/sequences.parquet"
SIDECARS = "sequences/de_test"


def without_stage(tree: Path, stage: str) -> None:
    path = tree / SIDECARS / "quality.json"
    document = json.loads(path.read_text())
    del document["stages"][stage]
    path.write_text(json.dumps(document))


def thumbnail(tree: Path) -> bytes:
    image: bytes = pq.read_table(tree / "mini" / "mini.parquet")["image"][0].as_py()
    return image


# What a checksum alone would find is tested without sealing the tree afterwards.
UNSEALED: dict[str, tuple[Corruption, str]] = {
    "a bit of a shard": (
        flip("data/de_test/lidar_front-000.tar", 600),
        r"lidar_front-000\.tar: checksum differs",
    ),
    "a bit of a table": (flip(TRAIN, 40), r"frames-train\.parquet"),
    "an untracked file": (
        lambda tree: (tree / "notes.txt").write_text("x") and None,
        r"notes\.txt: not in SHA256SUMS",
    ),
    "a lost schema": (
        remove("schemas/poses.schema.json"),
        r"poses\.schema\.json: in SHA256SUMS but not in the tree",
    ),
    "a broken checksum line": (
        text("SHA256SUMS", "  README.md", " README.md"),
        r"SHA256SUMS:\d+: not a checksum line",
    ),
    "no checksums": (remove("SHA256SUMS"), r"SHA256SUMS: missing"),
}

SEALED: dict[str, tuple[Corruption, str]] = {
    "a lost licence": (remove("LICENSE"), r"^LICENSE: missing"),
    "a lost split file": (remove("metadata/frames-test.parquet"), r"frames-test\.parquet: missing"),
    "a lost shard": (remove("data/de_test/labels-000.tar"), r"labels-000\.tar: missing, but"),
    "a lost sidecar": (remove(f"{SIDECARS}/provenance.json"), r"provenance\.json: file is missing"),
    "lost poses": (remove(f"{SIDECARS}/poses.json"), r"poses\.json: missing, though .* reports on poses"),
    "lost wheels": (
        remove(f"{SIDECARS}/wheel_excitation.json"),
        r"wheel_excitation\.json: missing, though .* reports on wheels",
    ),
    "images that privacy does not answer for": (
        lambda tree: without_stage(tree, "privacy"),
        r"quality\.json: images without a report of the privacy stage",
    ),
    "bytes behind a shard": (
        behind("data/de_test/camera_left-000.tar", b"raw image".ljust(512)),
        r"camera_left-000\.tar: holds bytes that belong to no member",
    ),
    "a file hidden under the name of another": (
        hidden_before("data/de_test/camera_left-000.tar"),
        r"camera_left-000\.tar: holds bytes that belong to no member",
    ),
    "a shard nobody refers to": (
        copy("data/de_test/labels-000.tar", "data/de_test/labels-001.tar"),
        r"labels-001\.tar: no member lies in it",
    ),
    "a sidecar of a stranger": (
        copy(f"{SIDECARS}/imu.parquet", "sequences/de_gone/imu.parquet"),
        r"sequences/de_gone/.*: sidecar of a sequence that",
    ),
    "an unknown column": (
        lambda tree: pq.write_table(
            pq.read_table(tree / TRAIN).append_column("extra", pa.array([1, 2])), tree / TRAIN
        ),
        r"frames-train\.parquet: wrong columns",
    ),
    "an unknown label state": (cell(TRAIN, "label_state", 0, "maybe"), r"label_state"),
    "a frame in two splits": (
        copy(TRAIN, "metadata/frames-test.parquet"),
        r"frame 0 is there twice",
    ),
    "a frame in the wrong file": (cell(TRAIN, "split", 0, "test"), r"frame 0 says split test"),
    "a frame lost": (rows(TRAIN, lambda found: found[1:]), r"belongs to no frame"),
    "time that stands still": (cell(UNASSIGNED, "t_ns", 1, 0), r"frame 2 does not increase"),
    "a frame of no sequence": (
        cell(TRAIN, "sequence", 0, "de_other"),
        r"de_other frame 0 belongs to no sequence",
    ),
    "has_camera_right of nothing": (
        cell(TRAIN, "has_camera_right", 1, False),
        r"has_camera_right contradicts",
    ),
    "a burst that is not there": (cell(TRAIN, "lidar_rear_burst", 0, 77), r"has_lidar_rear contradicts"),
    "not reviewed, with labels": (
        cell(TRAIN, "label_state", 0, "not_reviewed"),
        r"contradicts its label_state",
    ),
    "reviewed_none, with boxes": (
        cell(TRAIN, "label_state", 0, "reviewed_none"),
        r"contradicts the label state",
    ),
    "box counts": (cell(TRAIN, "boxes_negative", 0, 5), r"1 positive and 1 negative boxes, its frame says"),
    "ground-truth count": (cell(TRAIN, "gt_points", 0, 4), r"has 5 points, its frame says 4"),
    "a right image of another time": (
        cell(TRAIN, "right_t_ns", 0, 0),
        r"frame 0 has a right image of another time",
    ),
    "a right image without a time": (
        cell(TRAIN, "right_t_ns", 0, None),
        r"frame 0 has a right image without a time",
    ),
    "another place": (cell(TRAIN, "place", 0, "elsewhere"), r"frame 0 has another place than its sequence"),
    "frames of a sequence": (cell(SEQUENCES, "frames", 0, 7), r"states 7 frames, found 6"),
    "bytes of a sequence": (cell(SEQUENCES, "bytes", 0, 1), r"states 1 bytes"),
    "modalities of a sequence": (
        cell(SEQUENCES, "modalities", 0, "camera_left"),
        r"states modalities camera_left",
    ),
    "a sequence that ends early": (cell(SEQUENCES, "t_end_ns", 0, 0), r"ends before it starts"),
    "a sequence lost": (rows(SEQUENCES, lambda found: []), r"belongs to no sequence"),
    "sequences of the release": (field("release.json", "sequences", value=[]), r"sequences are not those"),
    "frames of the release": (
        field("release.json", "frames", "train", value=9),
        r"states 9 train frames, found 2",
    ),
    "files of the release": (field("release.json", "files", value=9), r"files or bytes are not those"),
    "an unknown field": (
        field("release.json", "extra", value=1),
        r"release\.json: .*does not fit schema release",
    ),
    "an offset": (cell(MEMBERS, "offset", 3, 1024), r"is not at the offset and size"),
    "a size": (cell(MEMBERS, "size", 3, 1), r"is not at the offset and size"),
    "a member's hash": (cell(MEMBERS, "sha256", 3, "0" * 64), r"differs from its sha256 in the member table"),
    "a member not listed": (rows(MEMBERS, lambda found: found[1:]), r"is packed but not in the member table"),
    "a member listed twice": (rows(MEMBERS, first_twice), r"is listed twice"),
    "a member misnamed": (cell(MEMBERS, "frame", 0, 3), r"is misnamed"),
    "a shard cut short": (
        write("data/de_test/camera_left-000.tar", b"x" * 700),
        r"camera_left-000\.tar: not a readable tar",
    ),
    "EXIF in an image": (member("camera_left", with_exif), r"carries EXIF"),
    "ICC or a second image's index": (
        member("camera_left", lambda jpeg: jpeg[:2] + b"\xff\xe2" + jpeg[4:]),
        r"carries a segment ff e2",
    ),
    "an image behind the image": (
        member("camera_left", lambda jpeg: jpeg[:-40] + b"\xff\xd9" + jpeg[-38:]),
        r"has bytes that are not of its image",
    ),
    "a thumbnail of no frame": (
        cell("mini/mini.parquet", "frame", 0, 77),
        r"mini\.parquet: .*77 is no frame",
    ),
    "a thumbnail in another split": (
        cell("mini/mini.parquet", "split", 0, "test"),
        r"mini\.parquet: .*has another split",
    ),
    "EXIF in a thumbnail": (
        lambda tree: cell("mini/mini.parquet", "image", 0, with_exif(thumbnail(tree)))(tree),
        r"mini\.parquet: .*carries EXIF",
    ),
    "an image cut short": (
        member("camera_right", lambda jpeg: jpeg[:-2] + b"\0\0"),
        r"is not one whole JPEG",
    ),
    "a scan that is no LAZ": (member("lidar_front", lambda laz: b"X" + laz[1:]), r"is not LAZ"),
    "ground truth that is no npz": (
        member("ground_truth", lambda npz: bytes(len(npz))),
        r"is not an npz with points",
    ),
    "ground truth that is half a zip": (
        member("ground_truth", lambda npz: b"PK\x03\x04" + bytes(len(npz) - 4)),
        r"is not an npz with points",
    ),
    "a label outside": (
        member("labels", label(b"0 0.95 0.5 0.2 0.1")),
        r"line 1 has a box outside the image",
    ),
    "a label in pixels": (member("labels", label(b"0 512 300 40 20")), r"line 1 has a box outside the image"),
    "an unknown class": (member("labels", label(b"2 0.5 0.5 0.2 0.1")), r"line 1 has an unknown class 2"),
    "a label of four numbers": (
        member("labels", label(b"0 0.5 0.5 0.2")),
        r"line 1 is not `class x y width height`",
    ),
    "a licence of a file": (
        cell(MEMBERS, "spdx", 0, "CC-BY-NC-4.0"),
        r"members\.parquet: .*is under CC-BY-NC-4\.0",
    ),
    "a licence of a thumbnail": (
        cell("mini/mini.parquet", "spdx", 0, "CC-BY-NC-4.0"),
        r"mini\.parquet: .*is under",
    ),
    "a licence of a source": (
        field(f"{SIDECARS}/provenance.json", "spdx", value="CC-BY-NC-4.0"),
        r"provenance\.json: under CC-BY-NC-4\.0",
    ),
    "another licence text": (
        text("LICENSE", "CC-BY-4.0", "CC-BY-NC-4.0"),
        r"LICENSE: does not name CC-BY-4\.0",
    ),
    "another cited version": (
        text("CITATION.cff", 'version: "0.1.0"', 'version: "0.0.9"'),
        r"CITATION\.cff: licence or",
    ),
    "a gate that failed": (
        field(f"{SIDECARS}/quality.json", "stages", "wheels", "gates", 0, "verdict", value="fail"),
        r"gate residual of wheels failed",
    ),
    "licence of the card": (
        text("README.md", "license: cc-by-4.0", "license: mit"),
        r"README\.md: license of the YAML",
    ),
    "a config of the card": (
        text("README.md", "frames-train", "frame-train"),
        r"README\.md: configs of the YAML",
    ),
    "no YAML in the card": (text("README.md", "---\n", "\n"), r"README\.md: does not open with YAML"),
    "broken YAML in the card": (text("README.md", "configs:", "configs: ["), r"README\.md: YAML is broken"),
    "a quaternion": (
        field(
            f"{SIDECARS}/calibration.json",
            "extrinsics",
            "rig_from_lidar_rear",
            "rotation_wxyz",
            value=[1, 0.1, 0, 0],
        ),
        r"rig_from_lidar_rear is not a rotation",
    ),
    "left and right": (
        field(
            f"{SIDECARS}/calibration.json",
            "extrinsics",
            "rig_from_camera_left",
            "translation_m",
            value=[9, 0, 0],
        ),
        r"camera_left is not left of camera_right",
    ),
    "a pose that is no rotation": (
        field(f"{SIDECARS}/poses.json", "poses", 1, "rotation_wxyz", value=[0.5, 0, 0, 0]),
        r"pose of camera_left 1",
    ),
    "poses out of time": (
        field(f"{SIDECARS}/poses.json", "poses", 2, "t_ns", value=5),
        r"camera_left 2 does not increase",
    ),
    "a pose of another frame": (
        field(f"{SIDECARS}/poses.json", "poses", 5, "index", value=55),
        r"camera_left 55 is not at the time of its frame",
    ),
    "a broken table": (write(f"{SIDECARS}/imu.parquet", b"PAR1"), r"imu\.parquet: unreadable"),
    "croissant of another version": (
        field("croissant.json", "conformsTo", value=["http://mlcommons.org/croissant/1.0"]),
        r"croissant\.json: conformsTo",
    ),
    "croissant without a shard": (
        lambda tree: rows_of_croissant(tree, "distribution"),
        r"croissant\.json: data/.* is not in its distribution",
    ),
    "croissant without a table's column": (
        field("croissant.json", "recordSet", 0, "field", value=[]),
        r"croissant\.json: recordSet frames-train is not that of",
    ),
    "croissant of another release": (
        field("croissant.json", "version", value="0.0.9"),
        r"croissant\.json: version is 0\.0\.9",
    ),
    "croissant that says nothing of people": (
        field("croissant.json", "rai:personalSensitiveInformation", value=""),
        r"croissant\.json: .*personalSensitiveInformation",
    ),
    "a file without a licence": (
        rows("metadata/files.parquet", lambda found: found[1:]),
        r"files\.parquet: .* has no licence",
    ),
    "a licence of a page": (
        cell("metadata/files.parquet", "spdx", 0, "CC-BY-NC-4.0"),
        r"files\.parquet: .* is stated as .*CC-BY-NC-4\.0",
    ),
    "an origin of a shard": (
        rows("metadata/files.parquet", lambda found: [row | {"sequences": "it_other"} for row in found]),
        r"files\.parquet: data/.* is stated as \('recorded', 'it_other'",
    ),
    "provenance of another sequence": (
        field(f"{SIDECARS}/provenance.json", "sequence", value="it_other"),
        r"provenance\.json: is of it_other",
    ),
    "provenance of another country": (
        field(f"{SIDECARS}/provenance.json", "country", value="IT"),
        r"provenance\.json: is of de_test, IT",
    ),
    "a file that was retracted": (
        lambda tree: retract(tree, "camera_left"),
        r"retractions\.parquet: de_test/000000\.camera_left\.jpg is retracted but there",
    ),
    "a row of a frame that was retracted": (
        lambda tree: retract(tree, "camera_left"),
        r"retractions\.parquet: de_test frame 0 is retracted but has a row",
    ),
    "a changelog that stops earlier": (
        text("CHANGELOG.md", "## 0.1.0", "## 0.0.9"),
        r"CHANGELOG\.md: no entry for version 0\.1\.0",
    ),
    "changes of another version": (
        field("changes.json", "to", value="0.0.9"),
        r"changes\.json: is about version 0\.0\.9",
    ),
}


def rows_of_croissant(tree: Path, name: str) -> None:
    path = tree / "croissant.json"
    document = json.loads(path.read_text())
    document[name] = [item for item in document[name] if not item["@id"].startswith("data/")]
    path.write_text(json.dumps(document))


def retract(tree: Path, modality: str) -> None:
    path = tree / "metadata" / "retractions.parquet"
    row = {"sequence": "de_test", "modality": modality, "frame": 0, "burst": None, "region": False,
           "reason": "person", "date": "2026-05-01", "version": "0.1.0"}  # fmt: skip
    pq.write_table(pa.Table.from_pylist([row], pq.read_table(path).schema), path)
