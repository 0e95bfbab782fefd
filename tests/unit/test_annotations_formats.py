"""Five formats, one table: round trips, readers of others, labels of others."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from label_corpus import sequence
from PIL import Image

from card.annotations.boxes import Box
from card.annotations.formats import FORMATS
from card.annotations.formats.expected import Expected
from card.annotations.import_labels import read_annotations

SIZE = (2248, 2252)
STEMS = ("1000", "2000", "3000", "4000")
FRAMES = {stem: 10 + number for number, stem in enumerate(STEMS)}


@st.composite
def boxes(draw: st.DrawFn) -> Box:
    """A box of at least 2 px anywhere in the image, its edges as fine as float64."""
    spans = []
    for size in SIZE:
        low = draw(st.floats(0, 1 - 2.5 / size))
        span = draw(st.floats(2 / size, 1 - low))
        spans.append((low + span / 2, span))
    (x, width), (y, height) = spans
    return Box(draw(st.sampled_from(("positive", "negative"))), x, y, width, height, 0)


labels = st.dictionaries(st.sampled_from(STEMS), st.lists(boxes(), max_size=4))


def written(form: str, found: dict[str, list[Box]], expected: Expected) -> dict[int, list[Box]]:
    """Labels after writing them in a format and reading that back, without any issue above a warning."""
    with tempfile.TemporaryDirectory() as scratch:
        named = {f"camera_left/{stem}.jpg": found[stem] for stem in sorted(found)}
        FORMATS[form].write(Path(scratch), named, expected)
        read, name, issues = read_annotations(Path(scratch), expected, "auto")
    assert {issue.code for issue in issues} <= {"near_duplicate", "small_overrun"}
    assert name == (form if found or form not in ("yolo", "voc") else None)
    return read


def assert_same(left: dict[int, list[Box]], right: dict[int, list[Box]], exact: bool = False) -> None:
    assert left.keys() == right.keys()
    for frame in left:
        assert [box.name for box in left[frame]] == [box.name for box in right[frame]]
        for a, b in zip(left[frame], right[frame], strict=True):
            if exact:
                assert replace(a, line=0) == replace(b, line=0)
            # A picometre of a pixel: what float64 keeps of a coordinate that was scaled and back.
            assert a.edges() == pytest.approx(b.edges(), abs=1e-15 * SIZE[0])


@pytest.mark.parametrize("form", FORMATS)
@settings(max_examples=60, deadline=None)
@given(found=labels)
def test_round_trip_loses_nothing(form, found):
    wanted = {FRAMES[stem]: boxes for stem, boxes in found.items()}
    assert_same(written(form, found, sequence(SIZE)), wanted, exact=form == "yolo")


@settings(max_examples=40, deadline=None)
@given(found=labels, order=st.permutations(list(FORMATS)))
def test_a_way_through_all_formats_loses_nothing(found, order):
    stems = {frame: stem for stem, frame in FRAMES.items()}
    passed = found
    for form in order:
        passed = {stems[frame]: boxes for frame, boxes in written(form, passed, sequence(SIZE)).items()}
    wanted = {FRAMES[stem]: boxes for stem, boxes in found.items()}
    assert_same({FRAMES[stem]: boxes for stem, boxes in passed.items()}, wanted)


def test_an_image_listed_without_boxes_is_reviewed_only_where_said(tmp_path):
    text = '<annotations>\n<image name="1000.jpg" width="100" height="80"/>\n</annotations>'
    (tmp_path / "a.xml").write_text(text)
    boxes, _, issues = read_annotations(tmp_path, sequence(), "auto")
    assert (boxes, [(i.line, i.code, i.severity) for i in issues]) == ({}, [(2, "unmarked_image", "warn")])
    boxes, _, issues = read_annotations(tmp_path, sequence(listed_is_reviewed=True), "auto")
    assert (boxes, issues) == ({10: []}, [])


def test_label_studio_skips_and_predictions_are_no_review(tmp_path):
    task = '{"data": {"image": "s3://b/1000.jpg"}, "annotations": [%s], "predictions": [{"result": [1]}]}'
    for annotations, wanted in (("", {}), ('{"was_cancelled": true}', {}), ('{"result": []}', {10: []})):
        (tmp_path / "a.json").write_text(f"[{task % annotations}]")
        boxes, _, issues = read_annotations(tmp_path, sequence(), "auto")
        assert (boxes, issues) == (wanted, [])


def test_byte_order_marks_and_blank_names_are_repaired(tmp_path):
    (tmp_path / "a.json").write_bytes(
        b'\xef\xbb\xbf{"images": [{"id": 1.0, "file_name": "C:\\\\data\\\\camera_left\\\\1000.jpg",'
        b' "width": 100, "height": 80}],\r\n "categories": [{"id": 1, "name": " positive "}],\r\n'
        b' "annotations": [{"image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4]}]}\r\n'
    )
    boxes, _, issues = read_annotations(tmp_path, sequence(), "auto")
    assert [(i.line, i.code) for i in issues] == [(1, "bom"), (1, "float_class"), (2, "stray_blanks")]
    assert boxes[10][0].edges() == pytest.approx((0.01, 0.025, 0.04, 0.075))


def drawn(found: dict[str, list[Box]]) -> dict[str, np.ndarray]:
    """Edges in px and class ids of each stem, as (N, 5)."""
    rows = {
        stem: [
            [*(np.array(box.edges()) * (*SIZE, *SIZE)), ("positive", "negative").index(box.name)]
            for box in boxes
        ]
        for stem, boxes in found.items()
    }
    return {stem: np.array(row).reshape(-1, 5) for stem, row in rows.items()}


@pytest.mark.parametrize("form", ["yolo", "voc", "coco"])
def test_a_second_reader_agrees(tmp_path, form):
    import supervision

    rng = np.random.default_rng(1)
    found = {}
    for stem in STEMS:
        centres, sizes = rng.uniform(0.3, 0.7, (6, 2)), rng.uniform(0.02, 0.5, (6, 2))
        names = rng.choice(["positive", "negative"], 6).tolist()
        found[stem] = [
            Box(n, *map(float, c), *map(float, s), 0) for n, c, s in zip(names, centres, sizes, strict=True)
        ]
    # This reader wants images, and a VOC file for every one of them.
    (tmp_path / "images").mkdir()
    for stem in STEMS:
        Image.new("RGB", SIZE).save(tmp_path / "images" / f"{stem}.jpg")
    FORMATS[form].write(tmp_path, {f"{stem}.jpg": found[stem] for stem in STEMS}, sequence(SIZE))
    images = str(tmp_path / "images")
    shift = np.zeros(4)
    if form == "yolo":
        (tmp_path / "data.yaml").write_text("names: [positive, negative]\n")
        read = supervision.DetectionDataset.from_yolo(
            images, str(tmp_path / "labels"), str(tmp_path / "data.yaml")
        )
    elif form == "voc":
        read = supervision.DetectionDataset.from_pascal_voc(images, str(tmp_path))
        shift[:2] = 1.0  # it counts pixels from 1, as the original VOC does
    else:
        read = supervision.DetectionDataset.from_coco(images, str(tmp_path / "annotations.json"))
    ours, _, issues = read_annotations(tmp_path, sequence(SIZE), form)
    assert issues == []
    wanted = drawn({stem: ours[FRAMES[stem]] for stem in STEMS})
    assert len(read) == len(STEMS)
    for path, _, detections in read:
        names = [("positive", "negative").index(read.classes[number]) for number in detections.class_id]
        theirs = np.column_stack([detections.xyxy + shift, names])
        np.testing.assert_allclose(theirs, wanted[Path(path).stem], atol=2e-3)  # it keeps float32


def of_others(*images: str, classes: list[str], size: tuple[int, int]) -> Expected:
    frames = {image: number for number, image in enumerate(images)}
    return replace(sequence(size), frames=frames, right=frozenset(), classes=classes)


def edges_px(boxes: list[Box], size: tuple[int, int]) -> list[tuple[str, list[float]]]:
    return [(box.name, (np.array(box.edges()) * (*size, *size)).round(9).tolist()) for box in boxes]


def test_voc_of_others(test_data):
    folder = test_data / "label_formats" / "voc_dataset" / "voc_dataset1"
    expected = of_others("2007_000001", classes=["cat", "person"], size=(20, 10))
    boxes, form, issues = read_annotations(folder, expected, "auto")
    assert (form, issues) == ("voc", [])
    assert edges_px(boxes[0], (20, 10)) == [("cat", [1, 2, 3, 4]), ("person", [4, 5, 6, 7])]


def test_voc_of_others_without_size_is_refused(test_data):
    folder = test_data / "label_formats" / "voc_dataset" / "voc_dataset2"
    expected = of_others("@", "a", "b", "c", "d", classes=["background"], size=(20, 10))
    boxes, form, issues = read_annotations(folder, expected, "auto")
    assert (boxes, form) == ({}, "voc")
    assert {(i.line, i.code) for i in issues} == {(1, "missing_field")}
    assert len(issues) == 5


def test_coco_of_others(test_data):
    folder = test_data / "label_formats" / "coco_dataset" / "coco_instances"
    expected = of_others("a", classes=["a", "b", "c"], size=(10, 5))
    boxes, form, issues = read_annotations(folder, expected, "coco")
    assert form == "coco"
    assert edges_px(boxes[0], (10, 5)) == [("b", [2, 2, 5, 3])]
    # The other file of the set is of an image that is not ours.
    assert {(i.code, i.file) for i in issues} == {
        ("orphan_label", "annotations/instances_val.json"),
        ("wrong_size", "annotations/instances_val.json"),
        ("not_a_box", "annotations/instances_val.json"),
    }


def test_cvat_of_others(test_data):
    folder = test_data / "label_formats" / "cvat_dataset"
    expected = of_others("img0", "img1", classes=["label1", "label2"], size=(8, 8))
    boxes, form, issues = read_annotations(folder / "for_images", expected, "auto")
    assert form == "cvat"
    assert edges_px(boxes[0], (8, 8)) == [("label1", [0, 2, 4, 4])]
    assert {(i.file, i.line, i.code) for i in issues} == {
        ("train.xml", 90, "not_a_box"),
        ("train.xml", 91, "not_a_box"),
        ("train.xml", 102, "wrong_size"),
    }
    boxes, form, issues = read_annotations(folder / "for_video", expected, "auto")
    assert form == "cvat"
    assert {i.code for i in issues} >= {"unsupported"}
    assert boxes == {}
