"""Leakage, balance and commercial lists of the splits."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from splits_drives import SETTINGS

from card.artifacts import load_schema, read_table, write_json, write_table
from card.errors import CardError
from card.splits.leakage import leakage_columns, percentile_m
from card.splits.report import report_splits, write_lists
from card.splits.tracks import Track, read_anchors, read_track

HEADER = "\t".join(load_schema("anchors")["properties"]) + "\n"


def write_sequence(folder: Path, splits: list[str], places: list[tuple[float, float]]) -> dict[str, Any]:
    count = len(splits)
    columns = {
        "frame": list(range(count)),
        "split": splits,
        "group": ["g"] * count,
        "stratum": ["none/town"] * count,
        "sampled": [True] * count,
    }
    write_table(folder / "splits.parquet", columns, "splits")
    poses = [
        {"kind": "image", "sensor": "camera_left", "index": index, "t_ns": index,
         "translation_m": [x, y, 0.0], "rotation_wxyz": [1.0, 0.0, 0.0, 0.0]}
        for index, (x, y) in enumerate(places)
    ]  # fmt: skip
    write_json(folder / "poses.json", {"schema": "poses", "poses": poses}, "poses")
    return {
        "id": folder.name,
        "place": "town",
        "splits": folder / "splits.parquet",
        "poses": folder / "poses.json",
    }


def test_distances_are_those_of_brute_force() -> None:
    rng = np.random.default_rng(0)
    tracks = {name: Track("map town", np.arange(50), rng.uniform(0, 100, (50, 2))) for name in "ab"}
    rows = [{"sequence": name, "frame": frame, "split": ("test", "train")[name == "b" or frame % 2]}
            for name in "ab" for frame in range(50)]  # fmt: skip
    columns = leakage_columns(rows, tracks, dict.fromkeys("ab", "town"))
    train = np.concatenate([tracks["a"].places_m[1::2], tracks["b"].places_m])
    wanted = [np.linalg.norm(train - place, axis=1).min() for place in tracks["a"].places_m[::2]]
    np.testing.assert_allclose(columns["distance_m"], wanted)
    assert percentile_m(columns, 5) == pytest.approx(np.percentile(wanted, 5, method="lower"))


def test_without_a_common_map_a_neighbour_is_unknown_and_another_town_apart() -> None:
    tracks = {name: Track(name, np.arange(1), np.zeros((1, 2))) for name in "abc"}
    rows = [{"sequence": name, "frame": 0, "split": split}
            for name, split in (("a", "test"), ("b", "train"), ("c", "test"))]  # fmt: skip
    columns = leakage_columns(rows, tracks, {"a": "town", "b": "town", "c": "village"})
    assert columns["state"] == ["unknown", "apart"]
    assert percentile_m(columns, 5) is None


def test_the_report_measures_anchored_sequences(tmp_path: Path) -> None:
    anchors = tmp_path / "anchors.tsv"
    # b drives north from a point 30 m east of a's start: its world is turned by 90 degrees.
    anchors.write_text(HEADER + f"a\ttown\t0\t0\t0\nb\ttown\t30\t0\t{np.pi / 2:.6f}\n")
    sequences = [
        write_sequence(tmp_path / "a", ["train"] * 2, [(0, 0), (0, 40)]),
        write_sequence(tmp_path / "b", ["test", "validation"], [(0, 0), (40, 0)]),
    ]
    paths = {name: tmp_path / f"{name}.parquet" for name in ("leakage", "balance")}
    report = tmp_path / "report.json"
    report_splits(sequences=sequences, anchors=anchors, **paths, report=report, settings=SETTINGS, gates=[])
    leakage = read_table(paths["leakage"], "split_leakage").to_pylist()
    assert [(row["frame"], row["train_sequence"], row["train_frame"]) for row in leakage] == [(0, "a", 0)]
    assert leakage[0]["distance_m"] == pytest.approx(30)
    found = {figure["name"]: figure["value"] for figure in json.loads(report.read_text())["figures"]}
    assert found["leak_m_p5"] == pytest.approx(30)
    # Shares 0.5, 0.25, 0.25 against 0.6, 0.2, 0.2.
    assert found["stratum_deviation"] == pytest.approx((0.1 + 0.05 + 0.05) / 3)
    balance = read_table(paths["balance"], "split_balance").to_pylist()
    assert {row["stratum"] for row in balance} == {"all", "none/town"}


def test_an_anchor_turns_and_moves_a_track(tmp_path: Path) -> None:
    write_sequence(tmp_path / "b", ["test"], [(40, 0)])
    anchors = tmp_path / "anchors.tsv"
    anchors.write_text(HEADER + f"b\ttown\t30\t-5\t{np.pi / 2:.9f}\n")
    track = read_track(tmp_path / "b" / "poses.json", "b", read_anchors(anchors))
    np.testing.assert_allclose(track.places_m, [[30, 35]], atol=1e-6)
    anchors.write_text(HEADER + "b\ttown\t0\t0\t0\n" * 2)
    with pytest.raises(CardError, match="sequence anchored twice"):
        read_anchors(anchors)


def test_commercial_lists_name_the_frames_of_each_split(tmp_path: Path) -> None:
    write_sequence(tmp_path / "a", ["train", "test", "unassigned"], [])
    out = {split: tmp_path / f"{split}.txt" for split in ("train", "test", "zero_shot")}
    write_lists({"card-germany": {"a": tmp_path / "a" / "splits.parquet"}}, out)
    assert out["train"].read_text() == "card-germany a 0\n"
    assert out["test"].read_text() == "card-germany a 1\n"
    assert out["zero_shot"].read_text() == ""
