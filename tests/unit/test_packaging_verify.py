"""A download is checked file by file, and what is bad is named."""

import shutil
from pathlib import Path

import pytest
from packaging_drive import build_tree

from card.artifacts import sha256_file
from card.cli import main
from card.errors import CardError
from card.packaging.reader import verify as verify_module
from card.packaging.reader.verify import verify

SHARD = "data/de_test/camera_left-000.tar"


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("verify"))


@pytest.fixture
def tree(valid: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(valid, tmp_path / "copy"))


def damage(path: Path, at: int) -> None:
    content = bytearray(path.read_bytes())
    content[at] ^= 1
    path.write_bytes(content)


def test_a_good_copy_has_no_findings(tree: Path, tmp_path: Path) -> None:
    assert verify(tree, tmp_path / "done") == []


def test_the_damaged_member_of_a_shard_is_named(tree: Path, tmp_path: Path) -> None:
    damage(tree / SHARD, 700)
    assert verify(tree, tmp_path / "done") == [f"{SHARD}: damaged member de_test/000000.camera_left.jpg"]


def test_damage_between_members_and_of_a_table_is_named(tree: Path, tmp_path: Path) -> None:
    damage(tree / SHARD, 300)
    damage(tree / "metadata" / "sequences.parquet", 30)
    assert verify(tree, tmp_path / "done") == [
        f"{SHARD}: damaged between its members",
        "metadata/sequences.parquet: damaged",
    ]


def test_without_a_readable_index_the_shard_is_still_named(tree: Path, tmp_path: Path) -> None:
    damage(tree / SHARD, 700)
    (tree / "metadata" / "members.parquet").write_bytes(b"PAR1")
    first = verify(tree, tmp_path / "done")[0]
    assert first.startswith(f"{SHARD}: damaged member unknown")


def test_missing_and_strange_files_are_named(tree: Path, tmp_path: Path) -> None:
    (tree / SHARD).unlink()
    (tree / "notes.txt").write_text("x")
    assert verify(tree, tmp_path / "done") == [f"{SHARD}: missing", "notes.txt: not of this release"]
    assert verify(tree, tmp_path / "done", partial=True) == ["notes.txt: not of this release"]


def test_a_stopped_check_goes_on_where_it_stopped(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []

    def counted(path: Path) -> str:
        if len(read) == 5:
            raise KeyboardInterrupt
        read.append(path.name)
        return sha256_file(path)

    monkeypatch.setattr(verify_module, "sha256_file", counted)
    with pytest.raises(KeyboardInterrupt):
        verify(tree, tmp_path / "done")
    monkeypatch.setattr(
        verify_module, "sha256_file", lambda path: read.append(path.name) or sha256_file(path)
    )
    assert verify(tree, tmp_path / "done") == []
    assert len(read) == len((tree / "SHA256SUMS").read_text().splitlines())
    damage(tree / SHARD, 700)  # good before, changed since
    assert len(verify(tree, tmp_path / "done")) == 1


def test_a_folder_without_checksums_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CardError, match="no list of checksums"):
        verify(tmp_path, tmp_path / "done")


def test_command_line(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", str(tree)]) == 0
    damage(tree / SHARD, 700)
    assert main(["verify", str(tree)]) == 1
    told = capsys.readouterr()
    assert "damaged member de_test/000000.camera_left.jpg" in told.out
    assert "the copy is not good (found 1 bad parts)" in told.err
