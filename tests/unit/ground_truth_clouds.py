"""Clouds in the camera frame for the tests of hidden-point removal."""

from __future__ import annotations

import numpy as np


def street(count: int, seed: int, half_width: float = 0.95, half_height: float = 0.75) -> np.ndarray:
    """Road, house fronts and poles with 8 mm of noise: points (count, 3) within the given u and v."""
    rng = np.random.default_rng(seed)
    parts: list[np.ndarray] = []
    while sum(map(len, parts)) < count:
        kind = rng.integers(0, 10, count)
        x, y = np.empty(count), np.empty(count)
        z = 0.5 + 80 * rng.random(count) ** 1.5
        road, pole = kind < 5, kind == 9
        x[road], y[road] = rng.uniform(-8, 8, road.sum()), 1.5 + 0.02 * np.sin(z[road])
        for side, front in ((-8, (kind >= 5) & (kind < 7)), (8, (kind >= 7) & (kind < 9))):
            x[front], y[front] = side + 0.3 * np.sin(z[front] / 3), rng.uniform(-4, 1.5, front.sum())
        number, angle = rng.integers(0, 40, pole.sum()), rng.uniform(0, 2 * np.pi, pole.sum())
        x[pole], y[pole] = (
            np.where(number % 2, -6, 6) + 0.15 * np.cos(angle),
            rng.uniform(-3, 1.5, pole.sum()),
        )
        z[pole] = 3 + 2.0 * number + 0.15 * np.sin(angle)
        points = np.stack([x, y, z], axis=1) + rng.normal(0, 0.008, (count, 3))
        inside = (points[:, 2] > 0.3) & (np.abs(points[:, 0]) < half_width * points[:, 2])
        parts.append(points[inside & (np.abs(points[:, 1]) < half_height * points[:, 2])])
    return np.ascontiguousarray(np.concatenate(parts)[:count])


def small(kind: str, seed: int) -> np.ndarray:
    """Up to 400 points of a kind that is easy to get wrong."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 200))
    lattice = np.c_[rng.integers(-5, 6, (count, 2)), rng.integers(1, 10, count)].astype(float)
    wall = np.c_[rng.integers(-20, 21, (count, 2)) * 0.25, np.full(count, 7.0)]
    rough = wall + np.c_[np.zeros((count, 2)), rng.normal(0, 0.005, count)]
    if kind == "uniform":
        return np.c_[rng.uniform(-1, 1, (count, 2)), np.ones(count)] * rng.uniform(1, 50, (count, 1))
    if kind == "ties":
        return lattice
    if kind == "duplicates":
        return lattice[rng.integers(0, count, 2 * count)]
    if kind == "plane":
        return wall
    if kind == "tiny":
        return rough[:8]
    if kind == "far":
        return rough + np.array([0, 0, 500.0])
    if kind == "ground":
        return np.c_[rng.uniform(-20, 20, count), np.full(count, 1.5), rng.uniform(1, 60, count)]
    if kind == "one ray":
        rough[: count // 2] = rough[: count // 2, 2:] * (2, 1, 1)
        return rough
    if kind == "sphere":
        directions = np.abs(rng.normal(size=(count, 3))) + np.array([0, 0, 0.05])
        return 10 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    raise ValueError(kind)
