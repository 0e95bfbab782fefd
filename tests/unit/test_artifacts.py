"""Artifacts are written once, whole and valid."""

import errno
import json
from pathlib import Path

import numpy as np
import pytest

from card.artifacts import (
    Figure,
    atomic_file,
    atomic_folder,
    inventory,
    logged,
    read_arrays,
    read_json,
    read_sheet,
    read_table,
    sha256_file,
    write_arrays,
    write_json,
    write_report,
    write_table,
)
from card.artifacts.schemas import check, default_settings, load_schema, schema_folder, with_defaults
from card.errors import CardError

GATE = {"figure": "rms_mm", "unit": "mm", "better": "lower", "threshold": 2.0}


def report(
    path: Path, value: float | None, overrides: list[dict[str, str]] | None = None
) -> dict[str, object]:
    figure = Figure("rms_mm", value, "mm", "Residual of the fit.")
    write_report(
        path,
        stage="wheels",
        settings={},
        inputs={},
        counts={},
        figures=[figure],
        gates=[GATE],
        overrides=overrides or [],
    )
    gate: dict[str, object] = read_json(path, "report")["gates"][0]
    return gate


def trajectory_columns(n: int = 3) -> dict[str, np.ndarray]:
    columns = {name: np.zeros(n) for name in ("x", "y", "z", "qx", "qy", "qz")}
    return {"t_ns": np.arange(n, dtype=np.int64), **columns, "qw": np.ones(n)}


def test_a_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    target.write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_file(target) as partial:
        partial.write_text("half")
        raise ZeroDivisionError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import pyarrow.parquet as pq

    def full(_table: object, where: Path, **_: object) -> None:
        Path(where).write_bytes(b"PAR1 half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pq, "write_table", full)
    target = tmp_path / "trajectory.parquet"
    with pytest.raises(
        CardError, match=r"trajectory.parquet: cannot write artifact \(found No space left on device\)"
    ):
        write_table(target, trajectory_columns(), "trajectory")
    assert list(tmp_path.iterdir()) == []


def test_a_failed_folder_keeps_the_old_one(tmp_path: Path) -> None:
    target = tmp_path / "frames"
    with atomic_folder(target) as partial:
        (partial / "a").write_text("1")
    with pytest.raises(CardError), atomic_folder(target) as partial:
        (partial / "b").write_text("2")
        raise CardError("stop")
    assert [p.name for p in target.iterdir()] == ["a"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_is_replaced_whole(tmp_path: Path) -> None:
    target = tmp_path / "frames"
    for name in ("a", "b"):
        with atomic_folder(target) as partial:
            (partial / name).write_text(name)
    assert [p.name for p in target.iterdir()] == ["b"]


def test_a_crash_between_the_renames_is_repaired(tmp_path: Path) -> None:
    (tmp_path / ".frames.old").mkdir()
    (tmp_path / ".frames.old" / "a").write_text("good")
    with pytest.raises(CardError), atomic_folder(tmp_path / "frames"):
        raise CardError("stop")
    assert (tmp_path / "frames" / "a").read_text() == "good"


def test_tables_repeat_to_the_byte(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_table(tmp_path / name, trajectory_columns(), "trajectory")
    assert sha256_file(tmp_path / "a") == sha256_file(tmp_path / "b")
    assert read_table(tmp_path / "a", "trajectory")["qw"].to_pylist() == [1.0, 1.0, 1.0]


@pytest.mark.parametrize(
    ("column", "values", "message"),
    [
        ("t_ns", [0, 2, 1], "t_ns does not increase"),
        ("x", [0.0, np.nan, 0.0], "x is not finite"),
        ("qw", [1.0, 1.5, 1.0], "qw out of range"),
        ("y", [0.0, None, 0.0], "nulls in column y"),
        ("z", ["a", "b", "c"], "column z does not fit"),
    ],
)
def test_a_table_that_breaks_its_schema_is_refused(
    tmp_path: Path, column: str, values: list[object], message: str
) -> None:
    with pytest.raises(CardError, match=message):
        write_table(tmp_path / "t.parquet", {**trajectory_columns(), column: values}, "trajectory")
    assert list(tmp_path.iterdir()) == []


def test_a_reader_checks_again(tmp_path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    path = tmp_path / "t.parquet"
    write_table(path, trajectory_columns(), "trajectory")
    table = pq.read_table(path)
    broken = table.set_column(table.column_names.index("x"), "x", pa.array([0.0, np.inf, 0.0]))
    pq.write_table(broken, path)
    with pytest.raises(CardError, match="x is not finite"):
        read_table(path, "trajectory")


def voxels(**changes: object) -> dict[str, object]:
    return {
        "origin": np.zeros(3),
        "voxel_size": np.float64(0.1),
        "ids": np.zeros((2, 3), np.int32),
        "counts": np.ones(2, np.int32),
        **changes,
    }


def test_arrays_repeat_to_the_byte(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        write_arrays(tmp_path / name, voxels(), "static_voxels")
    assert sha256_file(tmp_path / "a.npz") == sha256_file(tmp_path / "b.npz")
    assert read_arrays(tmp_path / "a.npz", "static_voxels")["ids"].shape == (2, 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"counts": np.ones(3, np.int32)}, "wrong shape of array counts"),
        ({"ids": np.zeros((2, 3))}, "wrong type of array ids"),
        ({"counts": np.zeros(2, np.int32)}, "counts out of range"),
        ({"more": np.zeros(1)}, "wrong arrays"),
    ],
)
def test_arrays_that_break_their_schema_are_refused(
    tmp_path: Path, changes: dict[str, object], message: str
) -> None:
    with pytest.raises(CardError, match=message):
        write_arrays(tmp_path / "v.npz", voxels(**changes), "static_voxels")


@pytest.mark.parametrize(
    ("value", "verdict"), [(1.5, "pass"), (2.5, "fail"), (None, "fail"), (float("nan"), "fail")]
)
def test_gates_fail_closed(tmp_path: Path, value: float | None, verdict: str) -> None:
    assert report(tmp_path / "r.json", value)["verdict"] == verdict


def test_an_override_is_signed_and_only_covers_failures(tmp_path: Path) -> None:
    override = [{"figure": "rms_mm", "signed_by": "A. Reviewer", "reason": "known gravel"}]
    failed = report(tmp_path / "r.json", 2.5, override)
    assert (failed["verdict"], failed["signed_by"]) == ("overridden", "A. Reviewer")
    assert report(tmp_path / "r.json", 1.0, override)["verdict"] == "pass"


def test_documents_refuse_nan_and_unknown_fields(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    report(path, 1.0)
    document = json.loads(path.read_text())
    with pytest.raises(CardError, match="Additional properties"):
        write_json(path, {**document, "extra": 1}, "report")
    for value, found in (
        (float("nan"), "nan"),
        ([[1.0, float("inf")], [2.0]], "inf"),
        (np.array([-np.inf]), "-inf"),
    ):
        with pytest.raises(CardError, match=rf"r\.json: number is not finite \(found {found}\)"):
            write_json(path, {**document, "settings": {"a": value}}, "report")
    assert json.loads(path.read_text()) == document
    path.write_text("{")
    with pytest.raises(CardError, match=r"r\.json:1: not JSON"):
        read_json(path, "report")


def test_inventory_is_sorted_and_hashes_content(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "x").write_text("1")
    (tmp_path / "a").write_text("22")
    columns = inventory(tmp_path)
    assert columns["name"] == ["a", "b/x"]
    assert columns["size"] == [2, 1]


def test_an_error_is_one_line_with_the_traceback_in_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "logs" / "stage.log"
    with pytest.raises(SystemExit), logged(log):
        raise CardError("broken", where="file:3", found=1, wanted=2)
    line = capsys.readouterr().err
    assert line == f"card: file:3: broken (found 1, wanted 2) [log: {log}]\n"
    assert "Traceback" in log.read_text()


def test_a_sheet_names_the_line(tmp_path: Path) -> None:
    sheet = tmp_path / "sequences.tsv"
    columns = list(load_schema("sequences")["properties"])
    sheet.write_text("\t".join(columns) + "\none\ttwo\n")
    with pytest.raises(CardError, match=r"sequences.tsv:2: wrong number of cells \(found 2"):
        read_sheet(sheet, "sequences")


def every_schema() -> list[str]:
    folder = schema_folder()
    return sorted(
        p.relative_to(folder).as_posix().removesuffix(".schema.json") for p in folder.rglob("*.json")
    )


def undescribed(node: object, path: str = "") -> list[str]:
    """Fields without a description and objects that stay open, anywhere in a schema."""
    if not isinstance(node, dict):
        return []
    found = []
    for name, field in {
        **node.get("properties", {}),
        **node.get("columns", {}),
        **node.get("arrays", {}),
    }.items():
        if "description" not in field and "$ref" not in field:
            found.append(f"{path}/{name} has no description")
        found += undescribed(field, f"{path}/{name}")
    if "properties" in node and node.get("additionalProperties") is not False:
        found.append(f"{path} is open")
    found += undescribed(node.get("items"), f"{path}[]")
    return found + undescribed(node.get("additionalProperties"), f"{path}{{}}")


@pytest.mark.parametrize("name", every_schema())
def test_every_schema_is_closed_and_described(name: str) -> None:
    from jsonschema import Draft202012Validator

    schema = load_schema(name)
    assert undescribed(schema) == []
    if "kind" not in schema:
        Draft202012Validator.check_schema(schema)
        if name.startswith("settings/"):
            assert all("default" in f or "properties" in f for f in schema["properties"].values())


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_a_document_with_a_number_that_json_lacks_is_refused(tmp_path: Path, number: str) -> None:
    path = tmp_path / "r.json"
    report(path, 1.0)
    path.write_text(path.read_text().replace('"value": 1.0', f'"value": {number}'))
    with pytest.raises(CardError, match=r"r\.json: number is not finite"):
        read_json(path, "report")


@pytest.mark.parametrize("damage", ["emptied", "deflate"])
def test_a_damaged_npz_is_named(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "v.npz"
    write_arrays(path, voxels(), "static_voxels")
    content = bytearray(path.read_bytes())
    content[60:90] = b"\xff" * 30
    path.write_bytes(content if damage == "deflate" else b"")
    with pytest.raises(CardError, match=r"v\.npz: unreadable npz"):
        read_arrays(path, "static_voxels")


def test_a_gate_in_another_unit_than_its_figure_is_refused(tmp_path: Path) -> None:
    gate = {"figure": "residual", "unit": "mm", "better": "lower", "threshold": 20}
    with pytest.raises(
        CardError, match=r"gate on residual has another unit than the figure \(found mm, wanted m\)"
    ):
        write_report(
            tmp_path / "r.json",
            stage="wheels",
            settings={},
            inputs={},
            counts={},
            figures=[Figure("residual", 0.5, "m", "Residual")],
            gates=[gate],
        )


@pytest.mark.parametrize("stage", ["splits", "packaging", "privcy"])
def test_a_gate_that_nothing_would_enforce_is_refused(stage: str) -> None:
    gate = {**GATE, "stage": stage, "threshold": dict.fromkeys(("tiny", "demo", "full"), 1.0)}
    check([{**gate, "stage": "privacy"}], "gates", "gates.yaml")
    with pytest.raises(CardError, match=r"gates.yaml: 0/stage does not fit schema gates"):
        check([gate], "gates", "gates.yaml")


@pytest.mark.parametrize("field", ["signed_by", "reason"])
def test_a_blank_signature_signs_nothing(field: str) -> None:
    override = {
        "sequences": ["drive"],
        "figure": "recall_face_pct_low",
        "signed_by": "A. Person",
        "reason": "gravel",
    }
    settings = default_settings("privacy") | {"overrides": [override | {field: " "}]}
    with pytest.raises(CardError, match=f"overrides/0/{field} does not fit schema"):
        check(settings, "settings/privacy", "config.yaml")


def test_defaults_are_filled_in_within_objects_and_arrays() -> None:
    inner = {"properties": {"size": {"default": 3}, "anything": True}}
    schema = {
        "properties": {"list": {"items": inner, "default": []}, "one": {**inner, "default": {}}, "x": True}
    }
    assert with_defaults({"list": [{}, {"size": 4}, 5]}, schema) == {
        "list": [{"size": 3}, {"size": 4}, 5],
        "one": {"size": 3},
    }
    assert with_defaults({}, schema)["list"] == []
