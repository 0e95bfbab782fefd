"""Trajectories as other systems write them: TUM and KITTI text files."""

from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import transform

Array = NDArray[np.float64]
Times = NDArray[np.int64]
NS = 1_000_000_000


def read_tum(path: Path, max_quaternion_error: float) -> tuple[Times, Array]:
    """Times (N,) in ns and poses (N, 4, 4) of lines ``t x y z qx qy qz qw``: seconds, metres.

    Raises
    ------
    CardError
        Naming the line: wrong number of columns, no number, times that do not increase, no unit quaternion.
    """
    lines = _lines(path, 8)
    t_ns = _increasing([_nanoseconds(cells[0], path, line) for line, cells in lines], lines, path)
    values = np.array([_numbers(cells[1:], path, line) for line, cells in lines])
    norms = np.linalg.norm(values[:, 3:], axis=1)
    _first_wrong(
        np.abs(norms - 1) > max_quaternion_error,
        norms,
        lines,
        path,
        "no unit quaternion",
        "norm 1; qx qy qz qw",
    )
    return t_ns, transform(values[:, :3], values[:, [6, 3, 4, 5]])


def read_kitti(path: Path, times: Path, max_rotation_error: float) -> tuple[Times, Array]:
    """Times (N,) in ns and poses (N, 4, 4) of lines of 12 numbers, the rows of [R | t], metres.

    times : file with one time a line, seconds on the recording's clock.

    Raises
    ------
    CardError
        As `read_tum`; also where the two files differ in length or R is no rotation.
    """
    lines = _lines(path, 12)
    stamps = _lines(times, 1)
    if len(stamps) != len(lines):
        raise CardError(
            "as many times as poses are needed", where=times, found=len(stamps), wanted=len(lines)
        )
    t_ns = _increasing([_nanoseconds(cells[0], times, line) for line, cells in stamps], stamps, times)
    rows = np.array([_numbers(cells, path, line) for line, cells in lines]).reshape(-1, 3, 4)
    rotation = rows[:, :, :3]
    error = np.abs(rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)).max(axis=(1, 2))
    error = np.where(np.linalg.det(rotation) > 0, error, 2.0)
    _first_wrong(error > max_rotation_error, error, lines, path, "no rotation", "R orthonormal, right-handed")
    poses = np.tile(np.eye(4), (len(lines), 1, 1))
    poses[:, :3] = rows
    return t_ns, poses


def _lines(path: Path, columns: int) -> list[tuple[int, list[str]]]:
    if not path.is_file():
        raise CardError("trajectory file is missing", where=path)
    lines = []
    for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        cells = text.replace(",", " ").split()
        if not cells or cells[0].startswith("#"):
            continue
        if len(cells) != columns:
            raise CardError(
                "wrong number of columns", where=f"{path}:{number}", found=len(cells), wanted=columns
            )
        lines.append((number, cells))
    if len(lines) < 2:
        raise CardError("too few lines", where=path, found=len(lines), wanted="at least 2")
    return lines


def _nanoseconds(text: str, path: Path, line: int) -> int:
    # A float64 of seconds since 1970 is only good to 200 ns.
    try:
        return int((Decimal(text) * NS).to_integral_value())
    except (InvalidOperation, ValueError, OverflowError):
        raise CardError("not a time", where=f"{path}:{line}", found=text, wanted="seconds") from None


def _numbers(cells: list[str], path: Path, line: int) -> list[float]:
    try:
        values = [float(cell) for cell in cells]
    except ValueError:
        raise CardError("not a number", where=f"{path}:{line}", found=" ".join(cells)) from None
    if not np.isfinite(values).all():
        raise CardError("number is not finite", where=f"{path}:{line}", found=" ".join(cells))
    return values


def _increasing(stamps: list[int], lines: list[tuple[int, list[str]]], path: Path) -> Times:
    t_ns = np.array(stamps, dtype=np.int64)
    back = np.flatnonzero(np.diff(t_ns) <= 0)
    if len(back):
        i = int(back[0])
        raise CardError(
            "times do not increase",
            where=f"{path}:{lines[i + 1][0]}",
            found=f"{lines[i + 1][1][0]} after {lines[i][1][0]}",
        )
    return t_ns


def _first_wrong(
    wrong: NDArray[np.bool_],
    values: Array,
    lines: list[tuple[int, list[str]]],
    path: Path,
    what: str,
    wanted: str,
) -> None:
    if wrong.any():
        i = int(np.argmax(wrong))
        raise CardError(what, where=f"{path}:{lines[i][0]}", found=f"{values[i]:.4f}", wanted=wanted)
