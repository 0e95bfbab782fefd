"""The space check counts what is still to be made."""

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

from card.errors import CardError
from card.recording.space import RESULTS_PER_RAW, SIMULATED_BYTES, require_space


class Usage(NamedTuple):
    total: int
    used: int
    free: int


def test_raw_and_simulated_bytes_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "x").write_bytes(bytes(1000))
    needed = SIMULATED_BYTES["tiny"] + RESULTS_PER_RAW * (1000 + SIMULATED_BYTES["tiny"])
    folders = [tmp_path / "a", tmp_path / "not-there"]
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, needed))
    require_space(tmp_path, folders, 1, "tiny")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, needed - 1))
    with pytest.raises(CardError, match="not enough disk space"):
        require_space(tmp_path, folders, 1, "tiny")
