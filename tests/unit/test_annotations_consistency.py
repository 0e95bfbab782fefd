"""Figures of a detector against labels: COCO's evaluator, our own, and cases done by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from label_scenes import random_scene, scene_of

from card.annotations.consistency.coco import coco_precision
from card.annotations.consistency.curves import average_precision, match
from card.annotations.consistency.table import as_markdown, at_confidence, best_confidence, consistency_rows

CLASSES = ("positive", "negative")


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_our_matching_equals_pycocotools(seed):
    scene = random_scene(seed)
    ours = np.array([average_precision(match(scene, number, "coco"), "coco") for number in (0, 1)])
    np.testing.assert_allclose(ours, coco_precision(scene, 2), rtol=0, atol=1e-12)


def test_a_second_evaluator_agrees():
    import supervision
    from supervision.metrics import MeanAveragePrecision

    scene = random_scene(5, images=20)
    metric = MeanAveragePrecision()
    for image in range(20):
        found, there = scene.detected_image == image, scene.labelled_image == image
        metric.update(
            [
                supervision.Detections(
                    scene.detected[found].astype(np.float32),
                    confidence=scene.confidence[found],
                    class_id=scene.detected_class[found],
                )
            ],
            [
                supervision.Detections(
                    scene.labelled[there].astype(np.float32), class_id=scene.labelled_class[there]
                )
            ],
        )
    result = metric.compute()
    rows = consistency_rows(scene, CLASSES)
    assert rows[0]["map50"] == pytest.approx(result.map50, abs=2e-3)
    assert rows[0]["map50_95"] == pytest.approx(result.map50_95, abs=2e-3)


def test_perfect_detections():
    boxes = [(0, 0, (0, 0, 10, 10)), (0, 1, (20, 0, 30, 10)), (1, 0, (0, 0, 50, 10))]
    scene = scene_of([(*box, 0.9) for box in boxes], boxes)
    for row in consistency_rows(scene, CLASSES):
        # 101 recalls and the trapezoid's last step: the other semantics never reaches 1.
        figures = [row[name] for name in ("precision", "recall", "map50", "map50_95")]
        assert figures == pytest.approx([1, 1, 1, 1])
        assert row["map50_interpolated"] == pytest.approx(0.995, abs=1e-3)


def test_by_hand():
    # Two labels; the surest detection misses, the next two hit: precision 0, 1/2, 2/3, its envelope 2/3.
    labels = [(0, 0, (0, 0, 10, 10)), (0, 0, (100, 0, 110, 10))]
    found = [
        (0, 0, (50, 50, 60, 60), 0.9),
        (0, 0, (0, 0, 10, 10), 0.8),
        (0, 0, (100, 0, 110, 10), 0.7),
    ]
    scene = scene_of(found, labels)
    total, positive, negative = consistency_rows(scene, CLASSES)
    assert positive["map50"] == pytest.approx(2 / 3)
    assert (positive["precision"], positive["recall"]) == (pytest.approx(2 / 3), 1)
    assert negative["instances"] == 0
    assert {negative[name] for name in negative if name not in ("class", "instances")} == {None}
    assert total["map50"] == positive["map50"]


def test_one_confidence_for_all_classes():
    labels = [(0, 0, (0, 0, 10, 10)), (0, 1, (100, 0, 110, 10))]
    found = [(0, 0, (0, 0, 10, 10), 0.9), (0, 1, (100, 0, 110, 10), 0.3), (0, 0, (50, 0, 60, 10), 0.2)]
    matches = [match(scene_of(found, labels), number, "coco") for number in (0, 1)]
    assert best_confidence(matches) == 0.3
    assert [at_confidence(one, 0.3) for one in matches] == [(1, 1), (1, 1)]


def test_two_detections_of_one_label_count_once():
    labels = [(0, 0, (0, 0, 10, 10))]
    found = [(0, 0, (0, 0, 10, 9), 0.9), (0, 0, (0, 0, 10, 10), 0.8)]
    scene = scene_of(found, labels)
    assert match(scene, 0, "coco").hit[0].tolist() == [True, False]
    assert match(scene, 0, "interpolated").hit[0].tolist() == [False, True]


def test_the_other_semantics_scores_higher():
    rows = [consistency_rows(random_scene(seed, images=20), CLASSES)[0] for seed in range(5)]
    gains = [row["map50_95_interpolated"] - row["map50_95"] for row in rows]
    assert min(gains) > 0.01


def test_nothing_detected_and_nothing_labelled():
    labels = [(0, 0, (0, 0, 10, 10))]
    row = consistency_rows(scene_of([], labels), CLASSES)[1]
    assert (row["precision"], row["recall"], row["map50"], row["map50_interpolated"]) == (None, 0, 0, 0)
    rows = consistency_rows(scene_of([(0, 0, (0, 0, 10, 10), 0.9)], []), CLASSES)
    assert {row["map50"] for row in rows} == {None}


def test_table_has_the_papers_form():
    labels = [(0, 0, (0, 0, 10, 10))]
    text = as_markdown("Test set", consistency_rows(scene_of([(*labels[0], 0.9)], labels), CLASSES))
    assert text.splitlines()[0] == "**Test set**"
    assert text.splitlines()[2].startswith(
        "| Class | Instances | Precision | Recall | mAP@.50 | mAP@.50–.95 |"
    )
    assert text.splitlines()[4].startswith("| All classes | 1 | 1.000 | 1.000 | 1.000 | 1.000 |")
    assert text.splitlines()[6].startswith("| Negative | 0 | – | – | – | – |")
