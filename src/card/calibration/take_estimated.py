"""Estimate mode of the calibration: the bundle that was made of a session's raw data."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from card.artifacts import read_json
from card.calibration.sequence import write_calibration


def take_estimated(
    *,
    bundle: Path,
    session: Path,
    calibration: Path,
    ego_mask: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Check an estimated bundle and write it as the calibration of a sequence.

    Parameters
    ----------
    bundle : made by `assemble_bundle`.
    session : the session's raw folder with perhaps ``ego_mask.png``; see `write_calibration`.
    calibration, ego_mask, report : the files to write.

    Raises
    ------
    CardError
        For a bundle that cannot be true; see `check_bundle`.
    """
    write_calibration(
        read_json(bundle, "calibration"),
        bundle,
        session,
        calibration=calibration,
        ego_mask=ego_mask,
        report=report,
        settings=settings,
        gates=gates,
    )
