"""The steps that take something out of the Hub's history, after the new version was sent."""

from collections.abc import Iterator

from card.packaging.versions import Records

LARGE = (".tar", ".parquet")


def history_steps(old: Records, new: Records, repository: str) -> Iterator[str]:
    """Lines of Markdown: what a person has to do on the Hub so that older versions are gone too.

    Deleting a file in a new commit leaves it in the history; so does a tag that still points there.
    """
    objects = sorted(
        {sha for path, sha in old.files.items() if path.endswith(LARGE)} - set(new.files.values())
    )
    was, now = old.about["version"], new.about["version"]
    yield f"# Remove {was} and before from the history of {repository}"
    yield ""
    yield f"1. See that {now} is there whole: `card verify` of a fresh download, tag `v{now}`."
    yield f"2. Delete the tags of all versions before: `v{was}` and older (`delete_tag`)."
    yield "3. Delete the refs of pull requests and other branches: each may hold an old file."
    yield f"4. Delete these {len(objects)} large files for good, with their history"
    yield "   (`permanently_delete_lfs_files(..., rewrite_history=True)`):"
    for sha in objects:
        names = sorted(path for path, found in old.files.items() if found == sha)
        yield f"   - `{sha}` {', '.join(names)}"
    yield "5. Squash what is left: `super_squash_history`, which small files and pages need."
    yield f"6. Cut the tag `v{now}` again on the new commit, for squashing moved it."
    yield "7. See that `refs/convert/parquet` was built anew and shows none of the retracted frames."
    yield "8. See that the viewer and cached copies of the pages show none of them."
    yield f"9. Tell those who have a copy: `card purge COPY hf://datasets/{repository}`."
