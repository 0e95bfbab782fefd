"""Write beside, then rename: a reader sees the old artifact or the whole new one, never a part."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from card.errors import CardError


@contextmanager
def atomic_file(path: Path) -> Iterator[Path]:
    """Yield a path beside ``path`` to write to; it replaces ``path`` when the block succeeds.

    Raises
    ------
    CardError
        If the file system refuses the write (disk full, no permission); nothing half-written stays.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise _cannot_write(path, error) from error
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield an empty folder beside ``path``; it takes the place of ``path`` when the block succeeds.

    Raises
    ------
    CardError
        If the file system refuses the write; the old folder then stays as it was.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    old = path.with_name(f".{path.name}.old")
    _restore(path, old)
    shutil.rmtree(partial, ignore_errors=True)
    try:
        partial.mkdir()
        yield partial
        if path.exists():
            os.replace(path, old)
        os.replace(partial, path)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        _restore(path, old)
        raise _cannot_write(path, error) from error
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _restore(path: Path, old: Path) -> None:
    # A crash between the two renames leaves only the old folder.
    if old.exists():
        if path.exists():
            shutil.rmtree(old, ignore_errors=True)
        else:
            os.replace(old, path)


def _cannot_write(path: Path, error: OSError) -> CardError:
    found = error.strerror or str(error)
    # What could not be read or written may be another file than the artifact.
    if error.filename is not None and ".partial" not in str(error.filename):
        found += f": {error.filename}"
    return CardError("cannot write artifact", where=path, found=found)
