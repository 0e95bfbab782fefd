"""Coverage of labelled objects and its exact bound, with scipy's binomial test as a second witness."""

import numpy as np
import pytest
from scipy.stats import binomtest

from card.errors import CardError
from card.privacy.recall import LabelledObject, covered_share, lower_bound, read_labels, recall_figures

SETTINGS = {
    "covered_share": 0.99,
    "confidence": 0.95,
    "min_height_px": {"face": 0, "plate": 0},
    "size_bins_px": [],
}
IMAGE = ("camera_left", 100)
HEADER = "camera,t_ns,kind,x_min,y_min,x_max,y_max\n"


def labelled(kind: str, *box: float) -> LabelledObject:
    return LabelledObject(IMAGE, kind, *box)


@pytest.mark.parametrize(("hits", "total"), [(0, 5), (1, 1), (37, 40), (300, 300)])
def test_lower_bound_equals_the_exact_binomial_test(hits, total):
    interval = binomtest(hits, total, alternative="greater").proportion_ci(0.95, method="exact")
    assert lower_bound(hits, total, 0.95) == pytest.approx(interval.low, abs=1e-12)


def test_coverage_counts_pixels_of_the_union():
    rng = np.random.default_rng(2)
    one = labelled("face", 10.2, 20, 39.9, 49)  # columns 11..39, rows 20..49
    areas = [(int(x), int(y), int(x) + 16, int(y) + 16) for x, y in rng.integers(0, 40, (6, 2))]
    mask = np.zeros((80, 60), dtype=bool)
    for x_min, y_min, x_max, y_max in areas:
        mask[y_min:y_max, x_min:x_max] = True
    assert covered_share(one, areas, (60, 80)) == mask[20:50, 11:40].mean()


def test_coverage_is_of_the_part_within_the_image():
    assert covered_share(labelled("face", -20, -20, 7, 7), [(0, 0, 8, 8)], (60, 80)) == 1.0
    assert covered_share(labelled("face", -20, -20, 8, 7), [(0, 0, 8, 8)], (60, 80)) == 8 / 9


def test_object_between_pixel_centres_is_its_nearest_pixel():
    assert covered_share(labelled("plate", 5.2, 5.2, 5.4, 5.4), [(5, 5, 6, 6)], (60, 80)) == 1.0


def test_object_outside_the_image_is_an_error():
    with pytest.raises(CardError, match="outside the image"):
        covered_share(labelled("face", 60, 5, 70, 9), [], (60, 80))


def test_figures_keep_faces_and_plates_apart():
    labels = [labelled("face", 0, 0, 9, 9), labelled("face", 0, 0, 9, 10), labelled("plate", 0, 0, 9, 9)]
    values = {
        figure.name: figure.value
        for figure in recall_figures(
            labels,
            {IMAGE: [(0, 0, 10, 10)]},
            {IMAGE: (60, 80)},
            settings=SETTINGS,
            where="labels",
        )
    }
    assert (values["recall_face_pct"], values["recall_plate_pct"]) == (50, 100)
    assert values["recall_plate_pct_low"] == pytest.approx(5)
    assert values["recall_face_pct_low"] == pytest.approx(100 * (1 - 0.95**0.5))


def test_without_labels_recall_is_unknown():
    figures = recall_figures([], {}, {}, settings=SETTINGS, where="labels")
    assert {"recall_face_pct_low", "recall_plate_pct_low"} <= {figure.name for figure in figures}
    assert all(figure.value is None for figure in figures)


def test_recall_is_divided_by_height_and_the_gate_counts_from_a_height_on():
    labels = [labelled("face", 0, 0, 9, height) for height in (5, 14, 20, 21)]
    found = recall_figures(
        labels,
        {IMAGE: [(0, 0, 10, 21)]},
        {IMAGE: (60, 80)},
        settings=SETTINGS | {"min_height_px": {"face": 10, "plate": 10}, "size_bins_px": [8, 20]},
        where="labels",
    )
    values = {figure.name: figure.value for figure in found}
    assert values["recall_face_pct"] == pytest.approx(200 / 3)
    assert values["recall_face_pct_0_10px"] == 100
    assert values["recall_face_pct_10_20px"] == 100
    assert values["recall_face_pct_20px"] == 50
    assert "recall_face_pct_8_20px" not in values


def test_label_of_an_unlisted_image_is_an_error():
    with pytest.raises(CardError, match="not in the frames"):
        recall_figures([labelled("face", 0, 0, 1, 1)], {}, {}, settings=SETTINGS, where="labels")


def test_reads_what_a_person_labelled(tmp_path):
    path = tmp_path / "privacy_labels.csv"
    path.write_text(HEADER + "camera_left,100,face,1,2.5,3,4\n")
    assert read_labels(path) == [labelled("face", 1, 2.5, 3, 4)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "wrong columns"),
        ("camera,t_ns\n", "wrong columns"),
        (HEADER + "camera_left,100,face,1,2,3,4\ncamera_left,100,face,1,2,3\n", "csv:3: row does not fit"),
        (HEADER + "camera_left,1e2,face,1,2,3,4\n", "csv:2: row does not fit"),
        (HEADER + "camera_left,100,cat,1,2,3,4\n", "csv:2: unknown kind"),
        (HEADER + "camera_left,100,face,3,2,1,4\n", "csv:2: box without an extent"),
        (HEADER + "camera_left,100,face,nan,2,1,4\n", "csv:2: box without an extent"),
    ],
)
def test_bad_label_rows_are_named_by_line(tmp_path, text, message):
    path = tmp_path / "privacy_labels.csv"
    path.write_text(text)
    with pytest.raises(CardError, match=message):
        read_labels(path)
