"""Send the commits of one version, tag the last, keep a record."""

import logging
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from card.artifacts import read_json, sha256_file
from card.errors import CardError
from card.packaging.reader.verify import SUMS
from card.packaging.upload.plan import Plan, batches, make_plan, remote_files
from card.packaging.upload.record import write_record

TRIES, PAUSE_S = 5, 1.0
T = TypeVar("T")
logger = logging.getLogger("card")


def send(tree: Path, records: Path, settings: Mapping[str, Any], api: Any) -> Plan:
    """Send a tree that is ready (`check_ready`); the plan that was carried out.

    One series of commits, shards first, then a tag `v<version>`, then the record under `records`. A stopped
    upload is taken up where it stopped: what the Hub has is not sent again. What may pass, such as a
    timeout, is tried again.

    Parameters
    ----------
    settings : `packaging.hub`. api : `huggingface_hub.HfApi`.

    CardError if the version was sent before with other content, or the Hub refuses.
    """
    about = read_json(tree / "release.json", "release")
    repository = f"{settings['namespace']}/{about['repository']}"
    version, tag = about["version"], f"v{about['version']}"
    tags = attempt(lambda: _tags(api, repository))
    plan = make_plan(tree, repository, attempt(lambda: remote_files(api, repository)))
    if (
        tag in tags
        and not make_plan(tree, repository, attempt(lambda: remote_files(api, repository, tag))).empty
    ):
        raise CardError(
            "this version was sent before, with other content",
            where=repository,
            found=tag,
            wanted="a higher packaging.release.version",
        )
    attempt(lambda: _prepare(api, repository, settings))
    commits = _commit_all(tree, repository, f"{about['repository']} {version}", settings, api)
    if tag not in tags:
        attempt(lambda: api.create_tag(repository, tag=tag, repo_type="dataset", exist_ok=True))
    write_record(
        records / about["repository"] / version,
        tree,
        {
            "schema": "upload",
            "repository": repository,
            "version": version,
            "tag": tag,
            "commits": commits,
            "new": sorted(plan.new),
            "changed": sorted(plan.changed),
            "deleted": list(plan.deleted),
            "bytes": plan.bytes,
            "checksums": sha256_file(tree / SUMS),
        },
    )
    return plan


def attempt(action: Callable[[], T]) -> T:
    """Result of `action`, tried again after a pause while it fails in a way that may pass."""
    for tried in range(TRIES):
        if tried:
            time.sleep(PAUSE_S * 2 ** (tried - 1))
        try:
            return action()
        except Exception as error:
            if not _may_pass(error):
                raise CardError("the Hub refuses", found=_line(error)) from error
            logger.warning("try %s of %s failed: %s", tried + 1, TRIES, _line(error))
            failure = error
    raise CardError(f"the Hub cannot be reached after {TRIES} tries", found=_line(failure)) from failure


def _commit_all(tree: Path, repository: str, title: str, settings: Mapping[str, Any], api: Any) -> list[str]:
    """Commit until the Hub has just the files of the tree; the hashes of the commits."""
    from huggingface_hub import CommitOperationAdd, CommitOperationDelete

    commits: list[str] = []

    def one() -> bool:
        # The plan is made anew for each commit and try: one whose answer got lost is not sent twice.
        parts = batches(
            make_plan(tree, repository, remote_files(api, repository)),
            settings["commit_files"],
            settings["commit_bytes"],
        )
        if not parts:
            return False
        paths, deleted = parts[0]
        operations: list[Any] = [
            CommitOperationAdd(path_in_repo=path, path_or_fileobj=tree / path) for path in paths
        ]
        operations += [CommitOperationDelete(path_in_repo=path) for path in deleted]
        message = title if len(parts) == 1 else f"{title}: {paths[0]} to {paths[-1]}"
        done = api.create_commit(repository, operations, commit_message=message, repo_type="dataset")
        logger.info("%s: %s files, %s deleted", done.oid, len(paths), len(deleted))
        commits.append(done.oid)
        return True

    while attempt(one):
        pass
    return commits


def _tags(api: Any, repository: str) -> set[str]:
    from huggingface_hub.errors import RepositoryNotFoundError

    try:
        return {ref.name for ref in api.list_repo_refs(repository, repo_type="dataset").tags}
    except RepositoryNotFoundError:
        return set()


def _prepare(api: Any, repository: str, settings: Mapping[str, Any]) -> None:
    """Create the repository if need be; a private or gated one is so before its first file."""
    api.create_repo(repository, repo_type="dataset", private=settings["private"], exist_ok=True)
    gated = False if settings["gated"] == "none" else settings["gated"]
    api.update_repo_settings(repository, repo_type="dataset", private=settings["private"], gated=gated)


def _may_pass(error: BaseException | None) -> bool:
    """Whether an error is the network's or a server's passing one."""
    while error is not None:
        status = getattr(getattr(error, "response", None), "status_code", None)
        if status is not None:
            return status >= 500 or status in (408, 429)
        # The client's HTTP library, httpx by one name or another, is not ours to import.
        if type(error).__module__.startswith("httpx") or isinstance(error, ConnectionError | TimeoutError):
            return True
        error = error.__cause__
    return False


def _line(error: BaseException) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]
