"""Uploads to a local server that speaks the Hub's API, with faults."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import huggingface_hub
import pytest
import yaml
from hub_server import Hub, hub
from huggingface_hub import constants
from packaging_drive import SETTINGS, assemble_tree, build_tree, sheet_row, write_drive, write_splits

from card.artifacts import read_json, sha256_file
from card.cli import main
from card.errors import CardError
from card.packaging.pack import pack_sequence
from card.packaging.reader import Release
from card.packaging.upload import send as send_module
from card.packaging.upload import upload
from card.packaging.validate import validate
from card.packaging.versions import read_records

REPOSITORY = "owner/card-germany"
ENDPOINTS = ("tree/main", "repos/create", "settings", "preupload", "objects/batch", "PUT /objects")
ENDPOINTS += ("commit/main", "tag/main")
FAULTS = [(where, what) for where in ENDPOINTS for what in (500, "cut")]
FAULTS += [("PUT /objects", "sleep"), ("commit/main", "sleep"), ("preupload", 429), ("commit/main", 503)]
ABOUT = {"creator": "A Lab", "authors": ["A. Person"], "contact": "data@lab.eu", "url": "https://lab.eu/card"}


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tree = build_tree(tmp_path_factory.mktemp("upload"))
    validate(tree, report=tree.with_name(f"{tree.name}.validation.json"), settings=SETTINGS)
    return tree


@pytest.fixture
def tree(built: Path, tmp_path: Path) -> Path:
    shutil.copytree(built.parent, tmp_path / "release")
    return tmp_path / "release" / "card-germany"


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Hub]:
    # Plain HTTP uploads: a server of the client's own storage protocol is not ours to write.
    monkeypatch.setattr(constants, "HF_HUB_DISABLE_XET", True)
    monkeypatch.setenv("HF_TOKEN", "hf_test")
    monkeypatch.setattr(send_module, "PAUSE_S", 0.0)
    pause = time.sleep
    monkeypatch.setattr("huggingface_hub.utils._http.time.sleep", lambda seconds: pause(min(seconds, 0.01)))
    huggingface_hub.utils.disable_progress_bars()
    huggingface_hub.set_client_factory(lambda: httpx2.Client(timeout=0.4, follow_redirects=True))
    with hub() as state:
        yield state
    huggingface_hub.utils.enable_progress_bars()
    huggingface_hub.close_session()
    huggingface_hub.set_client_factory(huggingface_hub.utils._http.default_client_factory)


def settings(server: Hub, **changed: Any) -> dict[str, Any]:
    target = SETTINGS["hub"] | {"namespace": "owner", "endpoint": server.address, "commit_files": 2}
    return SETTINGS | {"release": SETTINGS["release"] | ABOUT, "hub": target | changed}


def run(tree: Path, server: Hub, really: bool = True, **changed: Any) -> list[str]:
    return upload(tree, tree.parent / "records", settings(server, **changed), really)


def same(tree: Path, server: Hub) -> bool:
    there = {name: content for name, (content, _) in server.repositories[REPOSITORY].files.items()}
    there.pop(".gitattributes")
    return there == {
        path.relative_to(tree).as_posix(): path.read_bytes() for path in tree.rglob("*") if path.is_file()
    }


def test_without_being_told_only_the_plan_is_shown(tree: Path, server: Hub) -> None:
    lines = run(tree, server, really=False)
    files = sum(path.is_file() for path in tree.rglob("*"))
    size = sum(path.stat().st_size for path in tree.rglob("*") if path.is_file())
    assert lines[0] == f"{REPOSITORY}: {files} new, 0 changed, 0 deleted, 0 the same; {size} bytes to send"
    assert lines[-1] == "nothing was sent: this is the plan"
    assert not any(line.startswith(("POST", "PUT")) for line in server.requests)
    assert server.repositories == {}


def test_a_release_arrives_whole_as_one_series_of_commits_with_a_tag(tree: Path, server: Hub) -> None:
    assert run(tree, server)[-1] == "sent"
    assert same(tree, server)
    repository = server.repositories[REPOSITORY]
    assert repository.private
    assert len(repository.commits) == 3 + 1  # six shards by two, then all else
    assert all(message.startswith("card-germany 0.1.0") for message in repository.messages)
    assert repository.tags == {"v0.1.0": repository.files}
    record = tree.parent / "records" / "card-germany" / "0.1.0"
    document = read_json(record / "upload.json", "upload")
    assert document["commits"] == repository.commits
    assert document["checksums"] == sha256_file(tree / "SHA256SUMS")
    assert read_records(record).members == read_records(tree).members
    # Once more there is nothing to do.
    assert run(tree, server)[0].startswith(f"{REPOSITORY}: 0 new, 0 changed, 0 deleted")
    assert len(repository.commits) == 4


def test_a_later_version_sends_only_what_changed(tree: Path, server: Hub, tmp_path: Path) -> None:
    run(tree, server)
    sent = len(server.put())
    inputs = write_drive(tmp_path, sheet_row("de_test"))
    takedown = [
        {
            "sequence": "de_test",
            "frames": [3, 3],
            "lidar": [],
            "region": None,
            "reason": "person",
            "date": "2026-05-01",
        }
    ]
    pack_sequence(**inputs | {"takedowns": takedown})
    splits = write_splits(tmp_path / "s.parquet", ["train", "unassigned", "unassigned"] * 2)
    item = {"id": "de_test", "package": inputs["out"], "splits": splits}
    record = tree.parent / "records" / "card-germany" / "0.1.0"
    later = assemble_tree(tmp_path, [item], takedowns=takedown, version="1.0.0", previous=record)
    validate(later, report=later.with_name(f"{later.name}.validation.json"), settings=SETTINGS)
    chosen = settings(server) | {"release": SETTINGS["release"] | ABOUT | {"version": "1.0.0"}}
    upload(later, tree.parent / "records", chosen, True)
    assert same(later, server)
    assert set(server.repositories[REPOSITORY].tags) == {"v0.1.0", "v1.0.0"}
    shards = {path.removeprefix("PUT /objects/") for path in server.put()[sent:]}
    untouched = {sha256_file(path) for path in (tree / "data").rglob("lidar_*.tar")}
    assert not shards & untouched
    assert {sha256_file(path) for path in (later / "data").rglob("camera_*.tar")} <= shards


@pytest.mark.parametrize(("where", "what"), FAULTS)
def test_what_may_pass_is_tried_again(tree: Path, server: Hub, where: str, what: Any) -> None:
    server.faults.append((where, what))
    run(tree, server)
    assert server.faults == []
    assert same(tree, server)
    assert "v0.1.0" in server.repositories[REPOSITORY].tags


@pytest.mark.parametrize("where", ["commit/main", "tag/main", "repos/create"])
def test_an_answer_that_got_lost_does_nothing_twice(tree: Path, server: Hub, where: str) -> None:
    server.faults.append((where, "lose"))
    run(tree, server)
    assert same(tree, server)
    assert len(server.repositories[REPOSITORY].commits) == 4


def test_a_stopped_upload_is_taken_up_where_it_stopped(tree: Path, server: Hub) -> None:
    server.faults.append(("commit/main", "lose"))
    server.faults += [("commit/main", 403)]
    with pytest.raises(CardError, match=r"the Hub refuses \(found HfHubHTTPError"):
        run(tree, server)
    repository = server.repositories[REPOSITORY]
    assert repository.tags == {}
    assert not (tree.parent / "records").exists()
    done, stored = len(repository.commits), len(server.put())
    assert done == 1
    run(tree, server)
    assert same(tree, server)
    assert len(repository.commits) == 4
    # The two shards that were stored but not committed are not sent again.
    shards = {f"PUT /objects/{sha256_file(path)}" for path in (tree / "data").rglob("*.tar")}
    assert sorted(line for line in server.put() if line in shards) == sorted(shards)
    assert stored == 4


def test_a_server_that_stays_broken_is_told(tree: Path, server: Hub) -> None:
    server.faults += [("commit/main", 500)] * send_module.TRIES
    with pytest.raises(CardError, match=r"the Hub cannot be reached after 5 tries"):
        run(tree, server)


def test_a_gated_repository_states_its_text(tree: Path, server: Hub, tmp_path: Path) -> None:
    with pytest.raises(CardError, match="release states another gate"):
        run(tree, server, gated="manual", gate_text="Do not identify people.")
    with pytest.raises(CardError, match=r"packaging.hub.gate_text: placeholder \(found nothing"):
        run(tree, server, gated="manual")
    page = tree / "README.md"
    page.write_text(
        page.read_text().replace("---\n", "---\nextra_gated_prompt: Do not identify people.\n", 1)
    )
    sums = (tree / "SHA256SUMS").read_text().splitlines()
    lines = [f"{sha256_file(page)}  README.md" if line.endswith("  README.md") else line for line in sums]
    (tree / "SHA256SUMS").write_text("\n".join(lines) + "\n")
    validate(tree, report=tree.with_name(f"{tree.name}.validation.json"), settings=SETTINGS)
    run(tree, server, gated="manual", gate_text="Do not identify people.")
    repository = server.repositories[REPOSITORY]
    assert (repository.private, repository.gated) == (True, "manual")
    # Nobody can read a file before the gate is closed.
    first = next(i for i, line in enumerate(server.requests) if "commit/main" in line)
    assert any("settings" in line for line in server.requests[:first])


def test_a_version_that_was_sent_cannot_be_sent_otherwise(tree: Path, server: Hub) -> None:
    run(tree, server)
    (tree / "NOTICE").write_text((tree / "NOTICE").read_text() + "more\n")
    sums = [line for line in (tree / "SHA256SUMS").read_text().splitlines() if not line.endswith("  NOTICE")]
    (tree / "SHA256SUMS").write_text("\n".join([*sums, f"{sha256_file(tree / 'NOTICE')}  NOTICE"]) + "\n")
    validate(tree, report=tree.with_name(f"{tree.name}.validation.json"), settings=SETTINGS)
    with pytest.raises(CardError, match=r"this version was sent before, with other content \(found v0.1.0"):
        run(tree, server)


def test_a_tree_that_is_not_validated_or_has_changed_is_refused(tree: Path, server: Hub) -> None:
    report = tree.with_name(f"{tree.name}.validation.json")
    content = report.read_bytes()
    report.unlink()
    with pytest.raises(CardError, match="release was not validated"):
        run(tree, server)
    report.write_bytes(content)
    shard = next((tree / "data").rglob("camera_left*.tar"))
    with shard.open("r+b") as file:
        file.seek(600)
        file.write(b"x")
    with pytest.raises(CardError, match=r"has changed since it was validated: .*damaged member"):
        run(tree, server)
    with (tree / "SHA256SUMS").open("a") as sums:
        sums.write("\n")
    with pytest.raises(CardError, match="has changed since it was validated"):
        run(tree, server)
    assert server.requests == []


@pytest.mark.parametrize("name", ["creator", "contact", "url", "authors"])
@pytest.mark.parametrize("value", ["PLACEHOLDER x", "", "https://example.org/x"])
def test_placeholders_are_refused(tree: Path, server: Hub, name: str, value: str) -> None:
    chosen = settings(server)
    chosen["release"] |= {name: [value] if name == "authors" else value}
    with pytest.raises(CardError, match=rf"packaging.release.{name}: placeholder"):
        upload(tree, tree.parent / "records", chosen, True)
    assert server.requests == []


def test_another_version_than_the_tree_s_is_refused(tree: Path, server: Hub) -> None:
    chosen = settings(server)
    chosen["release"] |= {"version": "0.2.0"}
    with pytest.raises(CardError, match=r"release is of another version \(found 0.1.0, wanted 0.2.0"):
        upload(tree, tree.parent / "records", chosen, True)


def test_what_was_sent_can_be_read_again(tree: Path, server: Hub, tmp_path: Path) -> None:
    run(tree, server)
    for name, (content, _) in server.repositories[REPOSITORY].files.items():
        (tmp_path / "copy" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "copy" / name).write_bytes(content)
    copy = Release(tmp_path / "copy")
    assert copy.read("de_test", 3, "camera_left") == Release(tree).read("de_test", 3, "camera_left")


def test_command_line(tree: Path, server: Hub, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "config.yaml"
    chosen = {"release": ABOUT, "hub": {"namespace": "owner", "endpoint": server.address}}
    config.write_text(yaml.safe_dump({"packaging": chosen, "records": str(tmp_path / "records")}))
    assert main(["upload", str(tree), "--config", str(config)]) == 0
    assert "nothing was sent" in capsys.readouterr().out
    assert server.repositories == {}
    assert main(["upload", str(tree), "--config", str(config), "--send"]) == 0
    assert same(tree, server)
    assert (tmp_path / "records" / "card-germany" / "0.1.0" / "upload.json").is_file()
