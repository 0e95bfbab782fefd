"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def test_data() -> Path:
    """Folder of real recordings that are not part of the repository."""
    folder = os.environ.get("CARD_TEST_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("CARD_TEST_DATA names no folder with real recordings")
    return Path(folder)
