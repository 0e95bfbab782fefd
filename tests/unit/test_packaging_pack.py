"""Packages of one sequence."""

import hashlib
import io
import shutil
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from packaging_drive import FRAMES, sheet_row, write_drive, write_gated_report

from card.artifacts import inventory, read_json, read_table, write_table
from card.errors import CardError
from card.packaging.pack import pack_sequence


@pytest.fixture
def inputs(tmp_path: Path) -> dict[str, Any]:
    return write_drive(tmp_path, sheet_row())


def content(package: Path, row: dict[str, Any]) -> bytes:
    with (package / "data" / Path(row["shard"]).name).open("rb") as file:
        file.seek(row["offset"])
        return file.read(row["size"])


def packed(inputs: dict[str, Any]) -> dict[str, bytes]:
    pack_sequence(**inputs)
    rows = read_table(inputs["out"] / "members.parquet", "release_members").to_pylist()
    return {row["file"]: content(inputs["out"], row) for row in rows}


def test_each_file_arrives_byte_for_byte(inputs: dict[str, Any], tmp_path: Path) -> None:
    files = packed(inputs)
    frames = read_table(inputs["frames"], "frames").to_pylist()
    bursts = read_table(inputs["bursts"], "bursts").to_pylist()
    for row in frames:
        stem = f"de_test/{row['frame']:06d}"
        assert files[f"{stem}.camera_left.jpg"] == (inputs["anonymized"] / row["left_file"]).read_bytes()
        assert files[f"{stem}.camera_right.jpg"] == (inputs["anonymized"] / row["right_file"]).read_bytes()
        npz = inputs["ground_truth"] / f"{row['frame']:06d}.npz"
        assert files[f"{stem}.ground_truth.npz"] == npz.read_bytes()
    for row in bursts:
        raw = inputs["lidar_front"].parent / row["file"]
        assert files[f"de_test/{row['burst']:06d}.{row['lidar']}.laz"] == raw.read_bytes()
    assert len(files) == 2 * FRAMES + FRAMES + 2 * FRAMES + 4


def test_not_reviewed_has_no_label_file_and_none_found_an_empty_one(inputs: dict[str, Any]) -> None:
    files = packed(inputs)
    labels = {name: text for name, text in files.items() if ".labels." in name}
    assert sorted(labels) == [f"de_test/{frame:06d}.labels.txt" for frame in (0, 1, 3, 4)]
    assert labels["de_test/000001.labels.txt"] == b""
    rows = [line.split() for line in labels["de_test/000000.labels.txt"].decode().splitlines()]
    assert [row[0] for row in rows] == ["0", "1"]
    assert float(labels["de_test/000003.labels.txt"].split()[1]) == 1 / 3


def test_frames_say_what_was_packed(inputs: dict[str, Any]) -> None:
    pack_sequence(**inputs)
    rows = read_table(inputs["out"] / "frames.parquet", "package_frames").to_pylist()
    assert [row["label_state"] for row in rows][:3] == ["boxes", "reviewed_none", "not_reviewed"]
    assert [row["has_labels"] for row in rows] == [True, True, False, True, True, False]
    assert (rows[0]["boxes_positive"], rows[0]["boxes_negative"]) == (1, 1)
    assert [row["gt_points"] for row in rows] == [5, 6, 7, 8, 9, 10]
    assert all(row["has_lidar_rear"] and row["has_camera_right"] and row["has_ground_truth"] for row in rows)
    document = read_json(inputs["out"] / "sequence.json", "release_sequence")
    assert document["distance_m"] == pytest.approx(1.5 * (FRAMES - 1))
    assert (document["frames"], document["reviewed_frames"], document["boxes_positive"]) == (6, 4, 2)


def test_sidecars_and_inventory_are_complete(inputs: dict[str, Any]) -> None:
    pack_sequence(**inputs)
    folder = inputs["out"]
    assert sorted(path.name for path in (folder / "sidecars").iterdir()) == [
        "calibration.json",
        "imu.parquet",
        "poses.json",
        "provenance.json",
        "quality.json",
        "redactions.parquet",
        "road_planes.parquet",
        "wheel_excitation.json",
    ]
    listed = read_table(folder / "inventory.parquet", "inventory").to_pydict()
    there = inventory(folder)
    assert set(there["name"]) - set(listed["name"]) == {"inventory.parquet"}
    sources = read_json(folder / "sidecars" / "provenance.json", "provenance")["sources"]
    assert sources["poses"] == hashlib.sha256(inputs["poses"].read_bytes()).hexdigest()
    assert "anonymized" in sources


def test_same_input_same_bytes(tmp_path: Path) -> None:
    found = []
    for name in ("one", "elsewhere/two"):
        inputs = write_drive(tmp_path / name, sheet_row())
        pack_sequence(**inputs)
        found.append(inventory(inputs["out"]))
    assert found[0] == found[1]


def test_shards_are_split_by_the_setting(inputs: dict[str, Any]) -> None:
    pack_sequence(**inputs | {"settings": inputs["settings"] | {"shard_max_bytes": 10240}})
    parts = sorted(path.name for path in (inputs["out"] / "data").glob("camera_left-*"))
    assert len(parts) > 1
    assert parts[0] == "camera_left-000.tar"


def test_a_lidar_only_sequence_packs(inputs: dict[str, Any], tmp_path: Path) -> None:
    empty = {name: [] for name in read_table(inputs["frames"], "frames").column_names}
    write_table(inputs["frames"], empty, "frames")
    lacking = ("calibration", "poses", "wheel_excitation", "road_planes", "ground_truth", "anonymized", "imu",
               "labels", "label_states", "lidar_rear")  # fmt: skip
    files = packed(inputs | dict.fromkeys(lacking) | {"reports": {}})
    assert sorted(files) == [f"de_test/{burst:06d}.lidar_front.laz" for burst in range(FRAMES)]
    document = read_json(inputs["out"] / "sequence.json", "release_sequence")
    assert (document["modalities"], document["frames"], document["distance_m"]) == ("lidar_front", 0, None)


def test_an_image_that_is_not_listed_is_refused(inputs: dict[str, Any]) -> None:
    table = read_table(inputs["anonymized"] / "images.parquet", "images")
    write_table(inputs["anonymized"] / "images.parquet", table.slice(1), "images")
    with pytest.raises(CardError, match=r"sequence de_test, frame 0, camera_left: image was not anonymized"):
        pack_sequence(**inputs)
    assert not inputs["out"].exists()


def test_an_image_with_other_bytes_is_refused(inputs: dict[str, Any]) -> None:
    image = sorted((inputs["anonymized"] / "camera_right").iterdir())[2]
    image.write_bytes(image.read_bytes() + b"\0")
    with pytest.raises(CardError, match=r"000002\.camera_right\.jpg: content differs"):
        pack_sequence(**inputs)
    assert not inputs["out"].exists()


def test_a_raw_folder_in_place_of_the_anonymized_one_is_refused(
    inputs: dict[str, Any], tmp_path: Path
) -> None:
    raw = tmp_path / "raw"
    shutil.copytree(inputs["anonymized"], raw, ignore=shutil.ignore_patterns("*.parquet"))
    with pytest.raises(CardError, match=r"images\.parquet"):
        pack_sequence(**inputs | {"anonymized": raw})


def test_a_changed_burst_is_refused(inputs: dict[str, Any]) -> None:
    burst = sorted(inputs["lidar_rear"].iterdir())[0]
    burst.write_bytes(burst.read_bytes()[:-1])
    with pytest.raises(CardError, match=r"000000\.lidar_rear\.laz: content differs"):
        pack_sequence(**inputs)


def test_a_failed_gate_keeps_the_sequence_out(inputs: dict[str, Any], tmp_path: Path) -> None:
    report = write_gated_report(tmp_path / "wheels.report.json", "de_test", 0.03)
    with pytest.raises(CardError) as error:
        pack_sequence(**inputs | {"reports": inputs["reports"] | {"wheels": report}})
    for part in ("sequence de_test", "stage wheels", "residual = 0.03 m", "<= 0.02 m", "`quarantine`"):
        assert part in str(error.value)
    assert "\n" not in str(error.value)
    assert not inputs["out"].exists()


def test_a_signed_override_lets_it_in_and_is_kept(inputs: dict[str, Any], tmp_path: Path) -> None:
    override = {"figure": "residual", "signed_by": "A. Person", "reason": "gravel"}
    report = write_gated_report(tmp_path / "wheels.report.json", "de_test", 0.03, [override])
    pack_sequence(**inputs | {"reports": inputs["reports"] | {"wheels": report}})
    quality = read_json(inputs["out"] / "sidecars" / "quality.json", "quality")
    assert quality["stages"]["wheels"]["gates"][0]["reason"] == "gravel"


def test_a_report_of_another_sequence_is_refused(inputs: dict[str, Any], tmp_path: Path) -> None:
    report = write_gated_report(tmp_path / "wheels.report.json", "it_other", 0.01)
    with pytest.raises(CardError, match=r"report of another sequence \(found it_other"):
        pack_sequence(**inputs | {"reports": inputs["reports"] | {"wheels": report}})


def test_a_broken_artifact_leaves_the_old_package(inputs: dict[str, Any]) -> None:
    pack_sequence(**inputs)
    before = inventory(inputs["out"])
    inputs["poses"].write_text("{}")
    with pytest.raises(CardError, match=r"poses\.json"):
        pack_sequence(**inputs)
    assert inventory(inputs["out"]) == before


def test_packed_ground_truth_is_plain_numpy(inputs: dict[str, Any]) -> None:
    pack_sequence(**inputs)
    with tarfile.open(inputs["out"] / "data" / "ground_truth-000.tar") as tar:
        file = tar.extractfile("de_test/000002.ground_truth.npz")
        assert file is not None
        points = np.load(io.BytesIO(file.read()))["points"]
    assert points.shape == (7, 3)


def test_an_image_of_another_raw_image_is_refused(inputs: dict[str, Any]) -> None:
    raw = inputs["lidar_front"].parent
    image = sorted((raw / "camera_right").iterdir())[2]
    image.write_bytes(b"taken again")
    write_table(inputs["recording_inventory"], inventory(raw), "inventory")
    with pytest.raises(CardError, match="frame 2, camera_right: image was anonymized from another raw image"):
        pack_sequence(**inputs)
    assert not inputs["out"].exists()


def test_images_without_a_privacy_report_are_refused(inputs: dict[str, Any]) -> None:
    del inputs["reports"]["privacy"]
    with pytest.raises(CardError, match="sequence de_test: images without a report of the privacy stage"):
        pack_sequence(**inputs)


def test_a_report_of_another_stage_is_refused(inputs: dict[str, Any]) -> None:
    inputs["reports"]["privacy"] = inputs["reports"]["wheels"]
    with pytest.raises(CardError, match=r"report of another stage \(found wheels, wanted privacy"):
        pack_sequence(**inputs)


def test_an_imu_that_changed_after_ingest_is_refused(inputs: dict[str, Any]) -> None:
    table = read_table(inputs["imu"], "imu")
    write_table(inputs["imu"], table.slice(1), "imu")
    with pytest.raises(CardError, match=r"imu\.parquet: content differs from what ingest recorded"):
        pack_sequence(**inputs)


def test_a_burst_that_ingest_did_not_see_is_named(inputs: dict[str, Any]) -> None:
    listed = read_table(inputs["recording_inventory"], "inventory")
    bursts = [name.startswith("lidar_front/") for name in listed["name"].to_pylist()]
    write_table(inputs["recording_inventory"], listed.filter([not burst for burst in bursts]), "inventory")
    with pytest.raises(
        CardError, match=r"lidar_front/\d+\.laz: file is not in the inventory of the recording"
    ):
        pack_sequence(**inputs)
