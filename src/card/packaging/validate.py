"""Check a whole release tree before anybody else sees it."""

import contextlib
import logging
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import Figure, write_report
from card.errors import CardError
from card.packaging.checks.card_page import check_card_page
from card.packaging.checks.contents import read_contents
from card.packaging.checks.croissant import check_croissant, check_croissant_format
from card.packaging.checks.files import check_files
from card.packaging.checks.geometry import check_geometry
from card.packaging.checks.licenses import check_licenses
from card.packaging.checks.limits import check_limits
from card.packaging.checks.members import check_members
from card.packaging.checks.provenance import check_provenance
from card.packaging.checks.splits import check_splits
from card.packaging.checks.tables import check_tables

CHECKS = (
    check_files,
    check_provenance,
    check_tables,
    check_members,
    check_geometry,
    check_licenses,
    check_card_page,
    check_croissant,
)
logger = logging.getLogger("card")


def validate(
    tree: Path,
    *,
    report: Path | None,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]] = (),
    ledger: Sequence[Mapping[str, Any]] | None = None,
) -> None:
    """Check `tree`; CardError with the first finding and their number if there is any, all in the log.

    Parameters
    ----------
    report : where to state that the tree is valid; None writes none.
    ledger : rows of the split ledger, if the splits are to be checked against it.
    settings : of packaging; `load_dataset` adds loading all configs as a user would.
    """
    findings = find_problems(tree, ledger=ledger, load=settings["load_dataset"], limits=settings["hub"])
    for line in findings:
        logger.error("%s", line)
    if findings:
        more = f" and {len(findings) - 1} more, see the log" if len(findings) > 1 else ""
        raise CardError(f"release is not valid: {findings[0]}{more}", where=tree)
    if report is not None:
        write_report(
            report,
            stage="validation",
            settings=settings,
            inputs={"checksums": tree / "SHA256SUMS"},
            counts={"findings": 0, "files": sum(path.is_file() for path in tree.rglob("*"))},
            figures=[Figure("findings", 0, "1", "Faults found in the tree")],
            gates=gates,
        )


def find_problems(
    tree: Path,
    *,
    ledger: Sequence[Mapping[str, Any]] | None = None,
    load: bool = False,
    limits: Mapping[str, Any] | None = None,
) -> list[str]:
    """All findings, one line each, in the order of the checks; none for a valid tree.

    limits : settings `packaging.hub`, if the tree has to keep within them.
    """
    if not tree.is_dir():
        raise CardError("no release tree", where=tree)
    contents = read_contents(tree)
    findings = contents.findings + [line for check in CHECKS for line in check(contents)]
    if ledger is not None:
        findings += check_splits(contents, ledger)
    if limits is not None:
        findings += check_limits(contents, limits)
    if not findings:
        findings += check_croissant_format(contents)
    # An empty tree has no configs, and `datasets` would make one up.
    if load and contents.sequences and not findings:
        findings += _check_loading(tree)
    return findings


def _check_loading(tree: Path) -> list[str]:
    """Load every config of the card with `datasets`, offline and into a cache that is thrown away."""
    os.environ.setdefault("HF_HUB_OFFLINE", "1")
    import datasets

    findings = []
    with tempfile.TemporaryDirectory() as cache, _quiet(datasets):
        for config in datasets.get_dataset_config_names(str(tree)):
            try:
                datasets.load_dataset(str(tree), config, cache_dir=cache)
            except Exception as error:  # whatever a user would meet
                findings.append(f"README.md: load_dataset of {config} fails ({' '.join(str(error).split())})")
    return findings


@contextlib.contextmanager
def _quiet(datasets: Any) -> Any:
    datasets.disable_progress_bars()
    try:
        yield
    finally:
        datasets.enable_progress_bars()
