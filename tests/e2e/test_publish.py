"""A release is sent, a frame is taken down, the next version is sent: by the workflow, to a local Hub."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from hub_server import hub
from project import Project

from card.cli import main
from card.packaging.reader import Release

TOWN = "de_town_bumps"
ENTRIES = """takedowns:
  - {sequence: de_town_bumps, frames: 3, reason: person, date: 2026-05-01}
  - {sequence: de_town_bumps, frames: 1, reason: person, date: 2026-05-01,
     region: {camera: camera_right, x_min: 0, y_min: 0, x_max: 32, y_max: 32}}"""


def test_a_takedown_reaches_the_hub(built: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HF_HUB_DISABLE_XET", "1")
    monkeypatch.setenv("HF_TOKEN", "hf_test")
    tree = built.root / "results" / "release" / "card-germany"
    with (
        hub() as server,
        built.changed(
            "config/config.yaml",
            "packaging:\n  release:\n",
            f"packaging:\n  hub: {{namespace: owner, endpoint: '{server.address}'}}\n  release:\n"
            "    authors: [A. Person]\n    url: https://lab.eu/card\n",
        ),
    ):
        built.build("upload", "--config", "send=true")
        repository = server.repositories["owner/card-germany"]
        assert set(server.repositories) == {"owner/card-germany", "owner/card-italy"}
        assert set(repository.tags) == {"v0.1.0"}
        old = Path(shutil.copytree(tree, tmp_path / "old"))
        before = {path.name: path.stat().st_ino for path in (tree / "data" / TOWN).iterdir()}
        image = Release(tree).read(TOWN, 3, "camera_left")
        with (
            built.changed("config/takedowns.yaml", "takedowns: []", ENTRIES),
            built.changed("release/CHANGELOG.md", "## 0.1.0", "## 1.0.0\n\nTakedowns.\n\n## 0.1.0"),
        ):
            result = built.run("release")
            assert result.returncode != 0
            assert "call for a major version (found 0.1.0, wanted at least 1.0.0)" in result.stdout
            config = built.root / "config" / "config.yaml"
            text = config.read_text()
            config.write_text(
                text.replace(
                    "    url: https://lab.eu/card\n", '    url: https://lab.eu/card\n    version: "1.0.0"\n'
                )
            )
            built.build("upload", "--config", "send=true")
            config.write_text(text)
        assert set(repository.tags) == {"v0.1.0", "v1.0.0"}
        after = {path.name: path.stat().st_ino for path in (tree / "data" / TOWN).iterdir()}
        assert all(after[name] == before[name] for name in after if name.startswith("lidar_"))
        there = b"\0".join(content for content, _ in repository.files.values())
        assert image[len(image) // 2 :][:32] not in there
        filled, was = (Release(path).image(TOWN, 1, "camera_right") for path in (tree, old))
        assert np.abs(filled[4:28, 4:28].astype(int) - 128).max() <= 1
        np.testing.assert_array_equal(filled[40:], was[40:])
        changes = json.loads((tree / "changes.json").read_text())
        assert (changes["from"], changes["to"], changes["bump"]) == ("0.1.0", "1.0.0", "major")
        assert main(["purge", str(old), str(tree)]) == 0
        assert image[len(image) // 2 :][:32] not in b"\0".join(
            path.read_bytes() for path in old.rglob("*") if path.is_file()
        )
    shutil.rmtree(built.root / "config" / "releases")
    built.build("release")
