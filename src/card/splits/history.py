"""The ledger against what was committed of it: a row that moved is an error."""

import subprocess
from pathlib import Path

from card.errors import CardError
from card.splits.ledger import check_append_only


def check_kept(ledger: Path, revision: str = "HEAD") -> bool:
    """Check that the ledger only grew since a revision of its git repository; whether there is one.

    CardError naming the first line that was changed, moved or dropped.
    """
    committed = _committed(ledger, revision)
    if committed is None:
        return False
    try:
        check_append_only(committed, ledger.read_text(encoding="utf-8"))
    except CardError as error:
        raise CardError(
            f"{error.what}; a row was changed since {revision}",
            where=f"{ledger}, {error.where}",
            found=error.found,
            wanted=error.wanted,
        ) from None
    return True


def _committed(path: Path, revision: str) -> str | None:
    """Text of a file at a revision; None without git, outside a repository or where it is not tracked."""
    command = ["git", "-C", str(path.resolve().parent), "show", f"{revision}:./{path.name}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        return None
    return done.stdout if done.returncode == 0 else None
