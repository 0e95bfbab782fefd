"""Import mode of the calibration: a delivered bundle."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import read_json
from card.calibration.sequence import write_calibration
from card.errors import CardError

BUNDLE = "calibration.json"


def import_bundle(
    *,
    session: Path,
    calibration: Path,
    ego_mask: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Check the bundle a session folder holds and write it as the calibration of a sequence.

    Parameters
    ----------
    session : folder with ``calibration.json`` (schema ``calibration``) and perhaps ``ego_mask.png``; see
        `write_calibration`.
    calibration, ego_mask, report : the files to write.

    Raises
    ------
    CardError
        For an unknown session or a bundle that cannot be true; see `check_bundle`.
    """
    source = session / BUNDLE
    if not source.is_file():
        raise CardError(
            f"unknown calibration session {session.name}",
            where=session.parent,
            wanted="one of " + (", ".join(_available(session.parent)) or "none: no session holds a bundle"),
        )
    bundle = read_json(source, "calibration")
    if bundle["session"]["id"] != session.name:
        raise CardError(
            "bundle of another session", where=source, found=bundle["session"]["id"], wanted=session.name
        )
    bundle["session"]["mode"] = "import"
    write_calibration(
        bundle,
        source,
        session,
        calibration=calibration,
        ego_mask=ego_mask,
        report=report,
        settings=settings,
        gates=gates,
    )


def _available(sessions: Path) -> list[str]:
    return sorted(path.parent.name for path in sessions.glob(f"*/{BUNDLE}"))
