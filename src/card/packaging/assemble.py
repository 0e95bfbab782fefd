"""Stage `release`: the packages of one licence as a complete tree."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import (
    atomic_folder,
    progress,
    read_json,
    read_table,
    sha256_file,
    write_json,
    write_report,
    write_table,
)
from card.artifacts.schemas import schema_folder
from card.packaging.croissant import croissant
from card.packaging.files_table import file_columns
from card.packaging.metadata import write_metadata
from card.packaging.mini import mini_columns
from card.packaging.pages import write_pages
from card.packaging.placing import check_license, place
from card.packaging.reader import SPLITS, Release
from card.packaging.retractions import retraction_rows
from card.packaging.takedowns import whole_tombstones
from card.packaging.versions import changes, check_version, read_records

SHIPPED_SCHEMAS = (
    "calibration",
    "changes",
    "ground_truth_points",
    "imu",
    "poses",
    "provenance",
    "quality",
    "redactions",
    "release",
    "release_files",
    "release_frames",
    "release_members",
    "release_mini",
    "release_sequences",
    "retractions",
    "road_planes",
    "wheel_excitation",
)


def assemble(
    *,
    repository: str,
    spdx: str,
    terms: Mapping[str, Any],
    sequences: Sequence[Mapping[str, Any]],
    release_folder: Path,
    split_report: Path | None,
    takedowns: Sequence[Mapping[str, Any]],
    reviews: Mapping[str, Mapping[str, Any]],
    records: Sequence[Path],
    out: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Build the tree `out` from packages; it replaces an older one whole.

    Parameters
    ----------
    spdx, terms : the tree's licence and its entry of `config/licenses.yaml`.
    sequences : {id, package, splits} each: a package folder and the table of splits, None without frames.
    release_folder : templates and licence texts.
    split_report : report of the splits' leakage and balance, None without.

    takedowns : entries of `read_takedowns` about sequences of this tree.
    reviews : of the ground truth, as of `read_reviews`, by sequence of this tree.
    records : records of earlier releases of this repository as of `latest_records`: the last, and that of
        this version if it was sent before. What is different from the last is stated in `changes.json`.

    CardError when anything in a package is under another licence than the tree, something retracted is
    there, a released frame moved to another split, or the version does not tell what changed.
    """
    ordered = sorted(sequences, key=lambda item: item["id"])
    with atomic_folder(out) as tree:
        hashes: dict[str, str] = {}
        for item in progress(ordered, f"assemble {repository}"):
            check_license(item["id"], Path(item["package"]), spdx)
            hashes |= place(item["id"], Path(item["package"]), tree)
        rows = [read_json(Path(item["package"]) / "sequence.json", "release_sequence") for item in ordered]
        earlier = [read_records(record) for record in records]
        version = settings["release"]["version"]
        before = next((found for found in earlier if found.about["version"] != version), None)
        stones = [
            row
            for item in ordered
            for row in read_table(
                Path(item["package"]) / "retractions.parquet", "package_retractions"
            ).to_pylist()
        ]
        retracted = retraction_rows(
            [*stones, *whole_tombstones(takedowns)],
            before.retractions if before else [],
            version,
        )
        frames = write_metadata(tree, ordered, rows, retracted)
        mini = mini_columns(Release(tree), frames, settings["mini_frames"], settings["mini_side_px"])
        write_table(tree / "mini" / "mini.parquet", mini, "release_mini")
        (tree / "schemas").mkdir()
        for name in SHIPPED_SCHEMAS:
            file = f"{name}.schema.json"
            shutil.copyfile(schema_folder() / file, tree / "schemas" / file)

        document = {
            "schema": "release",
            "repository": repository,
            "version": version,
            "date": settings["release"]["date"],
            "spdx": spdx,
            "commercial": terms["commercial"],
            "sequences": [item["id"] for item in ordered],
            "frames": {split: sum(row["split"] == split for row in frames) for split in SPLITS},
            "files": sum(row["files"] for row in rows),
            "bytes": sum(row["bytes"] for row in rows),
            "overrides": _overrides(tree, [item["id"] for item in ordered]),
        }
        write_json(tree / "release.json", document, "release")
        write_pages(
            tree,
            templates=release_folder,
            release=document,
            sequences=rows,
            frames=frames,
            quality=[
                read_json(tree / "sequences" / item["id"] / "quality.json", "quality") for item in ordered
            ],
            reviews=reviews,
            retracted=len(retracted),
            terms=terms,
            about=settings["release"],
            gate=None if settings["hub"]["gated"] == "none" else settings["hub"]["gate_text"],
            splits=read_json(split_report, "report") if split_report else None,
            has_mini=bool(mini["frame"]),
        )
        paths = [path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file()]
        listed = file_columns(paths, document["sequences"], spdx)
        write_table(tree / "metadata" / "files.parquet", listed, "release_files")
        hashes |= _hash_rest(tree, hashes)
        _write_sums(tree, hashes)
        found = read_records(tree)
        for record in earlier:
            check_version(changes(record, found))
        difference = changes(before, found)
        write_json(tree / "changes.json", difference, "changes")
        hashes["changes.json"] = sha256_file(tree / "changes.json")
        write_json(
            tree / "croissant.json",
            croissant(document, terms, settings["release"], hashes, rows),
            "croissant",
        )
        hashes["croissant.json"] = sha256_file(tree / "croissant.json")
        _write_sums(tree, hashes)

    write_report(
        report,
        stage="release",
        settings=settings,
        inputs={"checksums": out / "SHA256SUMS"}
        | ({"split_report": split_report} if split_report else {})
        | {f"record_{record.name}": record / "release.json" for record in records}
        | {f"package_{item['id']}": Path(item["package"]) / "inventory.parquet" for item in ordered},
        counts={
            "sequences": len(rows),
            "frames": len(frames),
            "files": document["files"],
            "bytes": document["bytes"],
            "tree_files": len(hashes) + 1,
            "retractions": len(retracted),
            **{f"frames_{split}": count for split, count in document["frames"].items()},
        },
        gates=gates,
        notes=[
            f"{item['id']}: no row in the split ledger; run `snakemake assign_splits`"
            for item in ordered
            if _outside_ledger(frames, item["id"])
        ],
    )


def _overrides(tree: Path, sequences: Sequence[str]) -> list[dict[str, str]]:
    return [
        {
            "sequence": sequence,
            "stage": stage,
            **{name: gate[name] for name in ("figure", "signed_by", "reason")},
        }
        for sequence in sequences
        for stage, stated in read_json(tree / "sequences" / sequence / "quality.json", "quality")[
            "stages"
        ].items()
        for gate in stated["gates"]
        if gate["verdict"] == "overridden"
    ]


def _write_sums(tree: Path, hashes: Mapping[str, str]) -> None:
    sums = "".join(f"{sha256}  {path}\n" for path, sha256 in sorted(hashes.items()))
    (tree / "SHA256SUMS").write_text(sums, encoding="utf-8")


def _hash_rest(tree: Path, known: Mapping[str, str]) -> dict[str, str]:
    files = (path.relative_to(tree).as_posix() for path in tree.rglob("*") if path.is_file())
    return {path: sha256_file(tree / path) for path in sorted(files) if path not in known}


def _outside_ledger(frames: Sequence[Mapping[str, Any]], sequence: str) -> bool:
    # A gap between two blocks has no group either.
    groups = [row["group"] for row in frames if row["sequence"] == sequence and row["split"] != "zero_shot"]
    return bool(groups) and not any(groups)
