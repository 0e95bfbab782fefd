"""House rules of the workflow that no linter knows."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
RULE_FILES = sorted((ROOT / "workflow" / "rules").glob("*.smk"))
SCRIPTS = sorted((ROOT / "workflow" / "scripts").glob("*.py"))
RULE = re.compile(r"^(?:rule|checkpoint) (\w+):\n((?:    .*\n|\n)*)", re.MULTILINE)


def rules() -> list[tuple[str, str]]:
    return [match for path in RULE_FILES for match in RULE.findall(path.read_text())]


def test_there_are_rules_to_look_at() -> None:
    assert {"ingest", "poses", "ground_truth", "wheels", "privacy", "package"} <= {
        name for name, _ in rules()
    }


@pytest.mark.parametrize("path", RULE_FILES, ids=lambda path: path.stem)
def test_rule_files_open_with_what_they_need_and_make(path: Path) -> None:
    if RULE.search(path.read_text()):
        head = path.read_text().splitlines()[:2]
        assert head[0].startswith("# Needs:")
        assert head[1].startswith("# Makes:")


@pytest.mark.parametrize("path", RULE_FILES, ids=lambda path: path.stem)
def test_nothing_heavy_or_hollow_is_used(path: Path) -> None:
    text = path.read_text()
    for forbidden in (r"^\s+run:", r"^\s+shadow:", r"\btouch\(", r"\bdirectory\("):
        assert not re.search(forbidden, text, re.MULTILINE), forbidden


@pytest.mark.parametrize(("name", "body"), [(n, b) for n, b in rules() if "script:" in b and "output:" in b])
def test_every_script_rule_tracks_code_and_keeps_a_log(name: str, body: str) -> None:
    script = re.search(r'"\.\./scripts/(\w+)\.py"', body)
    assert script
    assert f'code=code("{script.group(1)}")' in body
    assert "log:" in body


@pytest.mark.parametrize("path", RULE_FILES, ids=lambda path: path.stem)
def test_no_rule_but_the_simulation_names_the_truth(path: Path) -> None:
    if path.stem != "simulation":
        assert not re.search(r"\btruth\b", re.sub(r"ground[ _]truth", "", path.read_text()).lower())


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_scripts_stay_thin(path: Path) -> None:
    lines = [line for line in path.read_text().splitlines() if line.strip()]
    assert len(lines) <= 25


def test_the_snakefile_stays_short() -> None:
    assert len((ROOT / "Snakefile").read_text().splitlines()) <= 80


def test_the_library_knows_nothing_of_snakemake() -> None:
    guilty = [
        path
        for path in (ROOT / "src").rglob("*.py")
        if re.search(r"\bimport snakemake|from snakemake", path.read_text())
    ]
    assert guilty == []
