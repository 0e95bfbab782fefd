"""Methods side by side: three references whose order is known, tables as Markdown, LaTeX and JSON."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmark_release import build_tree, predict, run
from scipy.ndimage import gaussian_filter

from card.artifacts import read_json
from card.benchmark.compare import compare
from card.errors import CardError


def smoothed(depth: np.ndarray) -> np.ndarray:
    """Mean of what is known round each pixel: bumps and holes gone."""
    weight = gaussian_filter((depth > 0).astype(float), 1.0)
    return np.where(weight > 1e-6, gaussian_filter(depth, 1.0) / np.maximum(weight, 1e-6), 0)


def noise(depth: np.ndarray) -> np.ndarray:
    return np.random.default_rng(0).uniform(2, 45, depth.shape)


#: From good to bad, once the scale is taken out.
REFERENCES = {"scaled": lambda depth: 1.02 * depth, "smoothed": smoothed, "noise_1": noise}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("release"))


@pytest.fixture(scope="module")
def evaluated(tree: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    work = tmp_path_factory.mktemp("methods")
    for name, change in REFERENCES.items():
        run(tree, predict(work / name, change))
    run(tree, predict(work / "completed", smoothed), task="completion")
    return [work / f"{name}-out" for name in (*REFERENCES, "completed")]


def compared(evaluations: list[Path], folder: Path) -> dict[str, Any]:
    names = {"out": "c.json", "table": "c.md", "tex": "c.tex", "report": "c.report.json"}
    return compare(evaluations=evaluations, **{key: folder / name for key, name in names.items()})


def test_the_metrics_put_the_references_in_order(evaluated: list[Path], tmp_path: Path) -> None:
    document = compared(evaluated, tmp_path)
    assert document == read_json(tmp_path / "c.json", "comparison")
    tables = {table["name"]: table for table in document["tables"]}
    assert list(tables) == [
        "depth",
        "depth_scaled",
        "height",
        "height_scaled",
        "completion",
        "completion_without_input",
    ]
    for name in ("depth", "depth_scaled", "height", "height_scaled"):
        assert [row["method"] for row in tables[name]["methods"]] == list(REFERENCES)
        values = np.array([row["values"] for row in tables[name]["methods"]], dtype=float)
        for key, column in zip(tables[name]["columns"], values.T, strict=True):
            steps = np.diff(column) * (-1 if "delta" in key else 1)
            assert (steps > 0).all(), (name, key, column)


def test_markdown_states_what_every_method_was_evaluated_on(evaluated: list[Path], tmp_path: Path) -> None:
    compared(evaluated, tmp_path)
    text = (tmp_path / "c.md").read_text()
    assert text.count("profile `default`") == 4
    assert text.count("3 boxes (1 empty") == 4
    tables = [block for block in text.split("\n\n") if block.startswith("|")]
    assert [len(block.splitlines()) for block in tables] == [5, 5, 5, 5, 3, 3]


def test_latex_has_the_papers_form(evaluated: list[Path], tmp_path: Path) -> None:
    compared(evaluated, tmp_path)
    text = (tmp_path / "c.tex").read_text()
    assert text.count(r"\begin{table*}") == text.count(r"\end{table*}") == 6
    assert r"\multicolumn{2}{c}{AbsRel $\downarrow$}" in text
    assert r"\multicolumn{2}{c}{iMAE [1/m] $\downarrow$}" in text
    assert r"Height $\delta@10$\,cm $\uparrow$" in text
    first = text.split(r"\end{table*}")[0]
    assert re.search(r"^scaled & \\best\{0\.020\} & \\best\{0\.020\} &", first, re.MULTILINE)
    assert r"noise\_1 &" in first
    body = re.findall(r"^(?:scaled|smoothed|noise\\_1) &.*$", first, re.MULTILINE)
    assert [line.count("&") for line in body] == [14] * 3
    assert "4 frames, 3 boxes, 1 of them empty" in first
    assert r"scaled 100.00\,\%" in first
    assert text.count("{") == text.count("}")


def test_evaluations_of_another_protocol_are_not_compared(
    tree: Path, evaluated: list[Path], tmp_path: Path
) -> None:
    run(tree, predict(tmp_path / "other", smoothed), profile="pooled")
    with pytest.raises(CardError, match="other: evaluations with another settings"):
        compared([evaluated[0], tmp_path / "other-out"], tmp_path)
    assert not (tmp_path / "c.json").exists()


def test_twins_are_reported(tree: Path, evaluated: list[Path], tmp_path: Path) -> None:
    run(tree, predict(tmp_path / "twin", smoothed))
    findings = compared([*evaluated[:3], tmp_path / "twin-out"], tmp_path)["findings"]
    assert "depth: the rows of smoothed and twin are identical" in findings
    assert "- depth: the rows of smoothed and twin are identical" in (tmp_path / "c.md").read_text()
    report = read_json(tmp_path / "c.report.json", "report")
    assert report["notes"] == findings
