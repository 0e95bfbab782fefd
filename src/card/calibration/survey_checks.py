"""Points of a survey that cannot be where their names say: found by what does not fit, mended or refused."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.calibration.survey_points import WHEEL_POINTS, Survey
from card.errors import CardError
from card.geometry.rigid_alignment import align, misfit

Array = NDArray[np.float64]


def with_sound_marks(
    survey: Survey, board_marks: Array, settings: Mapping[str, Any]
) -> tuple[Survey, list[str]]:
    """The survey with marks that have the shape of the board, and a note for each that was mended.

    Two points named one for the other get their names back; a single point off the shape of all others is
    taken out.

    Raises
    ------
    CardError
        If that is not what is wrong with a pose: the board moved while it was measured, say.
    """
    notes: list[str] = []
    marks = survey.marks.copy()
    for pose, name in enumerate(survey.poses):
        there = np.flatnonzero(np.isfinite(marks[pose, :, 0]))
        off = misfit(marks[pose, there], board_marks[there])
        limit = settings["max_mark_misfit_m"]
        if off.max() <= limit:
            continue
        order = _swapped(marks[pose, there], board_marks[there], limit)
        if order is not None:
            one, other = (f"p{there[i] + 1}" for i in order)
            marks[pose, there[list(order)]] = marks[pose, there[list(order[::-1])]]
            notes.append(f"{survey.name}, {name}: {one} and {other} were named one for the other; mended")
            continue
        stray = _stray(marks[pose, there], board_marks[there], limit)
        if stray is not None and len(there) > settings["min_marks"]:
            others = np.delete(there, stray)
            away = 1e3 * _distance(marks[pose], board_marks, others, int(there[stray]))
            marks[pose, there[stray]] = np.nan
            point = f"{survey.name}, {name}: p{there[stray] + 1}"
            notes.append(f"{point} lies {away:.0f} mm off where the others have it; not used")
            continue
        worst = there[np.argsort(-off)[:2]] + 1
        raise CardError(
            f"points of {name} do not have the shape of the board",
            where=survey.name,
            found=f"p{worst[0]} and p{worst[1]} farthest off, by {1e3 * np.sort(off)[-1]:.0f} mm",
            wanted=f"at most {1e3 * limit:g} mm; was the board moved while it was measured?",
        )
    return replace(survey, marks=marks), notes


def with_agreeing_wheels(
    surveys: Sequence[Survey], settings: Mapping[str, Any]
) -> tuple[list[Survey], list[str]]:
    """The surveys with wheel points of one shape, and a note for each pair that was named one for the other.

    Raises
    ------
    CardError
        Naming survey and point, if the wheels of a survey have another shape than those of the others.
    """
    limit = settings["max_wheel_misfit_m"]
    agree = np.array([[misfit(a.wheels, b.wheels).max() <= limit for b in surveys] for a in surveys])
    model = surveys[int(np.argmax(agree.sum(axis=1)))]
    mended, notes = [], []
    for survey in surveys:
        off = misfit(model.wheels, survey.wheels)
        order = None if off.max() <= limit else _swapped(survey.wheels, model.wheels, limit)
        if off.max() > limit and (order is None or 2 * agree.sum(axis=1).max() <= len(surveys)):
            point = " of ".join(WHEEL_POINTS[_odd(survey.wheels, model.wheels)][::-1])
            raise CardError(
                f"wheel points have another shape than in {model.name}",
                where=survey.name,
                found=f"{point} does not fit, the set is {1e3 * off.max():.0f} mm off",
                wanted=f"at most {1e3 * limit:g} mm",
            )
        if order is not None:
            wheels = survey.wheels.copy()
            wheels[list(order)] = wheels[list(order[::-1])]
            survey = replace(survey, wheels=wheels)
            one, other = (" of ".join(WHEEL_POINTS[i][::-1]) for i in order)
            notes.append(f"{survey.name}: {one} and {other} were named one for the other; mended")
        mended.append(survey)
    return mended, notes


def _swapped(points: Array, shape: Array, limit: float) -> tuple[int, int] | None:
    """The two points whose exchange makes all fit."""
    best, pair = limit, None
    for one, other in combinations(range(len(points)), 2):
        order = np.arange(len(points))
        order[[one, other]] = other, one
        off = float(misfit(points[order], shape).max())
        if off <= best:
            best, pair = off, (one, other)
    return pair


def _odd(points: Array, shape: Array) -> int:
    """The point without which the others fit best."""
    kept = [np.arange(len(points)) != left_out for left_out in range(len(points))]
    return int(np.argmin([misfit(points[mask], shape[mask]).max() for mask in kept]))


def _stray(points: Array, shape: Array, limit: float) -> int | None:
    """The point without which the others fit."""
    odd = _odd(points, shape)
    kept = np.arange(len(points)) != odd
    return odd if misfit(points[kept], shape[kept]).max() <= limit else None


def _distance(points: Array, shape: Array, others: NDArray[np.intp], point: int) -> float:
    a_from_b = align(points[others], shape[others])
    return float(np.linalg.norm(a_from_b[:3, :3] @ shape[point] + a_from_b[:3, 3] - points[point]))
