"""Rooms of the library: arrows go down only, stages do not import each other."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "card"
GROUND = {"geometry", "artifacts", "errors"}
FLOORS: dict[str, set[str]] = {
    "geometry": {"errors"},
    "artifacts": {"errors"},
    "recording": GROUND,
    "simulation": GROUND | {"recording"},
    "estimation": GROUND | {"recording"},
    "detection": GROUND,
    **{
        stage: GROUND | {"recording", "estimation", "detection"}
        for stage in (
            "calibration",
            "poses",
            "ground_truth",
            "wheels",
            "privacy",
            "annotations",
            "irregularities",
            "splits",
            "packaging",
        )
    },
    # They stand on a release and on what stages left, never on their code; the reader is for users.
    "benchmark": GROUND | {"packaging.reader"},
    "report": GROUND,
}


def imported(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return {name.removeprefix("card.") for name in names if name.startswith("card.")}


@pytest.mark.parametrize("room", sorted(FLOORS))
def test_arrows_go_down(room: str) -> None:
    allowed = FLOORS[room] | {room}
    files = sorted((PACKAGE / room).rglob("*.py"))
    assert files
    for path in files:
        for name in imported(path):
            assert any(name == floor or name.startswith(f"{floor}.") for floor in allowed), f"{path}: {name}"


def test_every_room_is_on_the_plan() -> None:
    rooms = {
        path.name
        for path in PACKAGE.iterdir()
        if path.is_dir() and path.name not in ("__pycache__", "schemas")
    }
    assert rooms == set(FLOORS)
