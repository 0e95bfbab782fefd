"""The hash of a stage's code changes with what the stage does, and with nothing else."""

import json
import shutil
from pathlib import Path

import pytest

from card.artifacts import code
from card.artifacts.code import code_hash
from card.artifacts.schemas import schema_folder

SCRIPT = """from card.artifacts import write_table

write_table(path, columns, "wheel_samples")
"""


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "stage.py"
    path.write_text(SCRIPT)
    return path


@pytest.fixture
def schema(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The schema that the script names, in a copy of the folder of schemas."""
    folder = tmp_path / "schemas"
    shutil.copytree(schema_folder(), folder)
    monkeypatch.setattr(code, "schema_folder", lambda: folder)
    path = folder / "wheel_samples.schema.json"
    path.write_text(json.dumps({"description": "d", "columns": {"x": {"type": "int32", "description": "d"}}}))
    return path


def edited(path: Path, old: str, new: str) -> Path:
    other = path.with_name(f"edited_{len(new)}") / path.name
    other.parent.mkdir()
    other.write_text(path.read_text().replace(old, new))
    return other


def test_comments_and_layout_do_not_count(script: Path) -> None:
    assert code_hash(edited(script, "columns, ", "columns,  # why\n")) == code_hash(script)


def test_a_statement_counts(script: Path) -> None:
    assert code_hash(edited(script, "columns", "others")) != code_hash(script)


def test_a_schema_that_the_code_names_counts(script: Path, schema: Path) -> None:
    before = code_hash(script)
    schema.write_text(schema.read_text().replace("int32", "int64"))
    assert code_hash(script) != before


def test_the_words_of_a_schema_do_not_count(script: Path, schema: Path) -> None:
    before = code_hash(script)
    schema.write_text(schema.read_text().replace('"d"', '"better said"'))
    assert code_hash(script) == before


def test_the_order_of_columns_counts(script: Path, schema: Path) -> None:
    columns = {"x": {"type": "int32"}, "y": {"type": "int32"}}
    schema.write_text(json.dumps({"columns": columns}))
    before = code_hash(script)
    schema.write_text(json.dumps({"columns": dict(reversed(columns.items()))}))
    assert code_hash(script) != before


def test_a_schema_of_others_does_not_count(script: Path, schema: Path) -> None:
    before = code_hash(script)
    schema.with_name("truth_world.schema.json").write_text("{}")
    assert code_hash(script) == before
