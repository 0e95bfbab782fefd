"""What a total station measured: marked points of the board in its poses, and the wheels."""

import csv
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import check
from card.errors import CardError

Array = NDArray[np.float64]

POINTS = "points.csv"
COLUMNS = ("target", "point", "x_m", "y_m", "z_m")
WHEELS = ("fl", "fr", "rl", "rr")
#: The order of a survey's wheel points.
WHEEL_POINTS = tuple((f"wheel_{wheel}", point) for wheel in WHEELS for point in ("center", "contact"))
#: Distances between marks as measured by those of the board: outside of this the unit is another one.
_SAME_UNIT = (0.5, 2.0)


@dataclass(frozen=True)
class Survey:
    """One survey, in the frame of its station, metres.

    poses : names of the board's poses.
    marks : (P, M, 3) of the board's M marked points in each pose; NaN where a point was not measured.
    wheels : (8, 3) in the order of `WHEEL_POINTS`.
    """

    name: str
    poses: tuple[str, ...]
    marks: Array
    wheels: Array


def read_surveys(folder: Path, board_marks: Array, settings: Mapping[str, Any]) -> list[Survey]:
    """The surveys below a folder, in order of their numbers.

    board_marks : (M, 3) the marked points in the board frame.
    settings : of ``calibration.rig_wheels``.

    Raises
    ------
    CardError
        If there are too few surveys, poses or points, a wheel point is missing, a row does not fit or repeats
        another, or the unit is not the metre; it names survey, pose and point.
    """
    found = sorted(folder.glob("survey-*"), key=lambda path: (len(path.name), path.name))
    surveys = [_read(path, board_marks, settings) for path in found if path.is_dir()]
    if len(surveys) < settings["min_surveys"]:
        raise CardError(
            "too few surveys", where=folder, found=len(surveys), wanted=f"at least {settings['min_surveys']}"
        )
    return surveys


def _read(folder: Path, board_marks: Array, settings: Mapping[str, Any]) -> Survey:
    path = folder / POINTS
    rows = _rows(path)
    for target, point in WHEEL_POINTS:
        if (target, point) not in rows:
            raise CardError(f"{point} of {target} is missing", where=path)
    poses = sorted(
        {target for target, _ in rows if target.startswith("pose-")}, key=lambda name: int(name[5:])
    )
    if len(poses) < settings["min_poses"]:
        raise CardError(
            "too few poses of the board",
            where=path,
            found=", ".join(poses) or "none",
            wanted=f"at least {settings['min_poses']}",
        )
    marks = np.full((len(poses), len(board_marks), 3), np.nan)
    for (target, point), place in rows.items():
        if target in poses:
            number = int(point[1:]) - 1 if re.fullmatch(r"p[1-9][0-9]*", point) else len(board_marks)
            if number >= len(board_marks):
                raise CardError(
                    f"{point} of {target} is no point of the board",
                    where=path,
                    wanted=f"p1 to p{len(board_marks)}",
                )
            marks[poses.index(target), number] = place
        elif (target, point) not in WHEEL_POINTS:
            raise CardError(
                f"{point} of {target} is no point of a wheel", where=path, wanted="center, contact"
            )
    for pose, places in zip(poses, marks, strict=True):
        count = int(np.isfinite(places[:, 0]).sum())
        if count < settings["min_marks"]:
            raise CardError(
                f"too few points of {pose}",
                where=path,
                found=count,
                wanted=f"at least {settings['min_marks']}",
            )
        _check_unit(places, board_marks, pose, path)
    return Survey(folder.name, tuple(poses), marks, np.array([rows[name] for name in WHEEL_POINTS]))


def _rows(path: Path) -> dict[tuple[str, str], Array]:
    if not path.is_file():
        raise CardError("file is missing", where=path)
    places: dict[tuple[str, str], Array] = {}
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        if tuple(reader.fieldnames or ()) != COLUMNS:
            raise CardError("wrong columns", where=path, found=reader.fieldnames, wanted=",".join(COLUMNS))
        for row in reader:
            where = f"{path}:{reader.line_num}"
            typed: dict[str, Any] = {
                name: row[name] if name in COLUMNS[:2] else _metres(row[name], where) for name in COLUMNS
            }
            check(typed, "survey_point", where)
            key = (typed["target"], typed["point"])
            if key in places:
                raise CardError(f"{key[1]} of {key[0]} is there twice", where=where)
            places[key] = np.array([typed[name] for name in COLUMNS[2:]], dtype=np.float64)
    return places


def _metres(cell: str | None, where: str) -> float:
    try:
        value = float(cell or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CardError("coordinate is not a number", where=where, found=repr(cell))
    return value


def _check_unit(places: Array, board_marks: Array, pose: str, path: Path) -> None:
    there = np.isfinite(places[:, 0])
    measured, drawn = (
        float(np.linalg.norm(np.std(points[there], axis=0))) for points in (places, board_marks)
    )
    ratio = measured / drawn
    if not _SAME_UNIT[0] < ratio < _SAME_UNIT[1]:
        raise CardError(
            f"points of {pose} are not in metres",
            where=path,
            found=f"{ratio:.3g} times as far apart as on the board{'; millimetres?' if ratio > 500 else ''}",
            wanted="coordinates in m",
        )
