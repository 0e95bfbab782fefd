"""One line for the user, everything else in the log; progress of long work."""

import logging
import sys
import traceback
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from card.errors import CardError

T = TypeVar("T")
logger = logging.getLogger("card")


@contextmanager
def logged(log: Path) -> Iterator[None]:
    """Run a stage: its messages go to ``log``; an error is one line on stderr and exit status 1."""
    log.parent.mkdir(parents=True, exist_ok=True)
    handler = logging.FileHandler(log, mode="w", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    except Exception as error:
        logger.error("%s", traceback.format_exc())
        text = str(error) if isinstance(error, CardError) else f"{type(error).__name__}: {error}"
        print(f"card: {' '.join(text.split())} [log: {log}]", file=sys.stderr, flush=True)
        raise SystemExit(1) from None
    finally:
        logger.removeHandler(handler)
        handler.close()


def progress(items: Iterable[T], label: str, total: int | None = None) -> Iterator[T]:
    """Iterate with a bar on a terminal; elsewhere a line in the log for each tenth of the work."""
    if total is None and isinstance(items, Sized):
        total = len(items)
    if sys.stderr.isatty():
        from tqdm import tqdm

        yield from tqdm(items, desc=label, total=total, leave=False, dynamic_ncols=True)
        return
    step = max(1, (total or 1000) // 10)
    for done, item in enumerate(items, 1):
        yield item
        if done % step == 0:
            logger.info("%s: %s of %s", label, done, total if total is not None else "?")
