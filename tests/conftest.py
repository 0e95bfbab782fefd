"""Fixtures shared by all tests."""

import os
from pathlib import Path

import pytest
from project import Project, copy_repository


@pytest.fixture(scope="session")
def test_data() -> Path:
    """Folder of real recordings that are not part of the repository."""
    folder = os.environ.get("CARD_TEST_DATA")
    if not folder or not Path(folder).is_dir():
        pytest.skip("CARD_TEST_DATA names no folder with real recordings")
    return Path(folder)


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The project after `snakemake release` at the tiny scale; a test puts back what it changes."""
    project = copy_repository(tmp_path_factory.mktemp("built"), "tiny")
    project.build("release")
    return project


@pytest.fixture
def fresh(tmp_path: Path) -> Project:
    """The project before anything ran."""
    return copy_repository(tmp_path, "tiny")
