"""Detections and labels to evaluate: by hand, and at random."""

from collections.abc import Sequence

import numpy as np

from card.annotations.consistency.scene import Scene

Labelled = tuple[int, int, tuple[float, ...]]
Detected = tuple[int, int, tuple[float, ...], float]


def scene_of(found: Sequence[Detected], labels: Sequence[Labelled]) -> Scene:
    """Detections (image, class, edges, confidence) and labels (image, class, edges)."""
    return Scene(
        np.array([row[2] for row in found], dtype=np.float64).reshape(-1, 4),
        np.array([row[0] for row in found], dtype=np.int64),
        np.array([row[1] for row in found], dtype=np.int64),
        np.array([row[3] for row in found], dtype=np.float64),
        np.array([row[2] for row in labels], dtype=np.float64).reshape(-1, 4),
        np.array([row[0] for row in labels], dtype=np.int64),
        np.array([row[1] for row in labels], dtype=np.int64),
    )


def random_scene(seed: int, images: int = 8, most: int = 6) -> Scene:
    """Labels with detections shifted, doubled, missing, mistaken and made up; confidences may tie."""
    rng = np.random.default_rng(seed)
    found: list[Detected] = []
    labels: list[Labelled] = []
    for image in range(images):
        for _ in range(int(rng.integers(0, most + 1))):
            low, size = rng.uniform(0, 1000, 2), rng.uniform(5, 400, 2)
            edges = np.concatenate([low, low + size])
            name = int(rng.integers(2))
            labels.append((image, name, tuple(edges)))
            for _ in range(int(rng.integers(0, 3))):
                moved = edges + rng.normal(0, rng.choice([0.01, 0.05, 0.3]), 4) * np.tile(size, 2)
                moved = np.concatenate([np.minimum(moved[:2], moved[2:] - 1), moved[2:]])
                guess = name if rng.uniform() < 0.9 else 1 - name
                found.append((image, guess, tuple(moved), round(float(rng.uniform()), 2)))
        for _ in range(int(rng.integers(0, 4))):
            low = rng.uniform(0, 1000, 2)
            edges = np.concatenate([low, low + rng.uniform(5, 400, 2)])
            found.append((image, int(rng.integers(2)), tuple(edges), round(float(rng.uniform()), 2)))
    return scene_of(found, labels)
