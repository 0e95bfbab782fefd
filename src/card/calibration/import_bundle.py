"""Import mode of the calibration: a delivered bundle, checked."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import Figure, read_json, write_json, write_report
from card.artifacts.masks import read_ego_mask, write_ego_mask
from card.calibration.checks import baseline, check_bundle
from card.errors import CardError

BUNDLE = "calibration.json"
MASK = "ego_mask.png"


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
    session : folder with ``calibration.json`` (schema ``calibration``) and, if the car is in the picture,
        ``ego_mask.png`` (8 bit, one channel, 255 = car, size of ``camera_left_undistorted``).
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
    check_bundle(bundle, settings, source)
    bundle["session"]["mode"] = "import"

    image = bundle["camera_left_undistorted"]
    inputs, notes = {"calibration": source}, []
    if (session / MASK).is_file():
        inputs["ego_mask"] = session / MASK
        mask = read_ego_mask(session / MASK, image["width"], image["height"])
    else:
        mask = np.zeros((image["height"], image["width"]), dtype=np.uint8)
        notes.append(f"{session.name} has no {MASK}: the mask is empty, the car's own parts stay in")

    write_json(calibration, bundle, "calibration")
    write_ego_mask(ego_mask, mask)
    write_report(
        report,
        stage="calibration",
        settings=settings,
        inputs=inputs,
        counts={"views": bundle["quality"]["views"], "ego_pixels": int(np.count_nonzero(mask))},
        figures=_figures(bundle),
        gates=gates,
        notes=notes,
    )


def _available(sessions: Path) -> list[str]:
    return sorted(path.parent.name for path in sessions.glob(f"*/{BUNDLE}"))


def _figures(bundle: Mapping[str, Any]) -> list[Figure]:
    quality = bundle["quality"]
    sigmas = [
        Figure(
            f"sigma_{name.removeprefix('rig_from_')}_mm",
            1e3 * float(np.sqrt(max(np.trace(np.asarray(rows)[:3, :3]), 0.0))),
            "mm",
            f"standard deviation of the position in {name}, as delivered",
        )
        for name, rows in sorted(bundle["covariances"].items())
    ]
    return [
        Figure("baseline_m", float(baseline(bundle["extrinsics"])[0]), "m", "stereo baseline along x"),
        Figure(
            "stereo_reprojection_px",
            quality["stereo_reprojection_px"],
            "px",
            "rms reprojection error of the stereo calibration, as delivered",
        ),
        Figure(
            "board_plane_rms_mm",
            1e3 * quality["board_plane_rms_m"],
            "mm",
            "rms distance of board returns to the board planes, as delivered",
        ),
        *sigmas,
    ]
