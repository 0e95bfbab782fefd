"""What a drive holds, listed and drawn."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from card.cli import main


def test_preview_lists_a_drive_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "pictures"
    assert main(["preview", "de_gravel_offroad", "--scale", "tiny", "--folder", str(folder)]) == 0
    text = capsys.readouterr().out
    assert "ISO 8608 class E" in text
    assert "pothole" in text
    assert sorted(p.name for p in folder.iterdir()) == ["stereo.png", "sweep.png", "top_view.png"]
    for path in folder.iterdir():
        assert np.asarray(Image.open(path).convert("L")).std() > 10  # something is to be seen
    assert Image.open(folder / "stereo.png").size == (280, 140)


def test_preview_refuses_a_moment_without_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = [
        "preview",
        "de_gravel_offroad",
        "--scale",
        "tiny",
        "--at",
        "5",
        "--folder",
        str(tmp_path / "p"),
    ]
    assert main(arguments) == 1
    assert "has no images at this time (found 5 s, wanted 2 to 2.4 s)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
