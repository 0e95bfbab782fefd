"""benchmarks/: the table of rows, the work folder and the discovery of modules."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
import yaml

from card.artifacts import read_json
from card.errors import CardError

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"


@pytest.fixture
def load(monkeypatch: pytest.MonkeyPatch):
    """Import a module of benchmarks/ as its scripts do, and forget it after the test."""
    monkeypatch.syspath_prepend(str(FOLDER))

    def load_module(name: str) -> ModuleType:
        monkeypatch.delitem(sys.modules, name, raising=False)
        return import_module(name)

    return load_module


def row(value: float | None, aim: float | None, better: str, stage: str = "poses") -> dict:
    return {"stage": stage, "figure": "f", "value": value, "unit": "mm", "aim": aim, "better": better}


@pytest.mark.parametrize(
    ("value", "aim", "better", "wanted"),
    [
        (3.0, 3.0, "lower", True),
        (3.1, 3.0, "lower", False),
        (3.0, 3.0, "higher", True),
        (2.9, 3.0, "higher", False),
        (None, 3.0, "lower", False),
        (1.0, None, "lower", None),
    ],
)
def test_an_aim_is_met_at_its_own_value(load, value, aim, better, wanted) -> None:
    assert load("rows").met(row(value, aim, better)) is wanted


def test_rows_are_printed_aligned_and_written_against_their_schema(load, tmp_path: Path, capsys) -> None:
    rows = [row(12.3456, 10, "lower", "wheels"), row(float("nan"), 0.5, "higher"), row(7, None, "lower")]
    load("rows").publish(rows, tmp_path / "rows.json")
    written = read_json(tmp_path / "rows.json", "benchmark_rows")
    assert [(line["stage"], line["value"]) for line in written] == [
        ("poses", None),
        ("poses", 7.0),
        ("wheels", 12.3456),
    ]
    lines = capsys.readouterr().out.splitlines()[:4]
    assert [line.split() for line in lines[1:]] == [
        ["poses", "f", "-", "mm", "≥", "0.5", "MISSED"],
        ["poses", "f", "7", "mm"],
        ["wheels", "f", "12.35", "mm", "≤", "10", "MISSED"],
    ]
    assert len({line.index(text) for line, text in zip(lines, ("unit", "mm", "mm", "mm"), strict=True)}) == 1


def test_a_row_with_a_strange_field_is_refused(load, tmp_path: Path) -> None:
    with pytest.raises(CardError, match="benchmark_rows"):
        load("rows").publish([row(1, 1, "lower") | {"note": "x"}], tmp_path / "rows.json")


def test_the_work_folder_has_its_own_scale_and_seed(load, tmp_path: Path) -> None:
    work = load("work").prepare(tmp_path / "tiny-7", "tiny", 7)
    config = yaml.safe_load((tmp_path / "tiny-7/config/config.yaml").read_text())
    assert (config["scale"], config["simulation"]["seed"]) == ("tiny", 7)
    assert work.sequences() == config["simulation"]["drives"]


def test_a_module_that_fails_does_not_hide_the_others(load, tmp_path: Path, monkeypatch, capsys) -> None:
    (tmp_path / "failing_kind").mkdir()
    (tmp_path / "failing_kind" / "bad.py").write_text("def rows():\n    raise ValueError('no truth')\n")
    (tmp_path / "failing_kind" / "good.py").write_text("def rows():\n    return [1]\n")
    run = load("run")
    monkeypatch.setattr(run, "HERE", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    assert run.collect("failing_kind", lambda module: module.rows()) == ([1], False)
    assert "no truth" in capsys.readouterr().err


def test_cpu_time_counts_children(load) -> None:
    command = "import time\nt = time.process_time()\nwhile time.process_time() - t < 0.2: pass"

    def work() -> None:
        import subprocess

        subprocess.run([sys.executable, "-c", command], check=True)

    assert 0.2 <= load("cost").cpu_s(work, 1) < 5
