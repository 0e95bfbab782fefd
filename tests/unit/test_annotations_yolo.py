"""A corpus of label files with the issues and boxes each must give."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from card.annotations.boxes import Rules
from card.annotations.formats.yolo import read_label_file
from card.annotations.issues import SEVERITIES
from card.artifacts import default_settings

CLASSES = ["positive", "negative"]
SETTINGS = default_settings("annotations")
RULES = Rules(
    (1000, 500),
    **{name: SETTINGS[name] for name in ("overrun_px", "overrun_share", "duplicate_iou", "subpixel_px")},
)
GOOD = "0 0.5 0.5 0.2 0.1\n"


def read(path: Path, content: bytes | str):
    path = path / "100.txt"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_label_file(path, "labels/100.txt", CLASSES, RULES)


# name: content, [(line, code)], number of boxes that are left
CORPUS: dict[str, tuple[bytes | str, list[tuple[int, str]], int]] = {
    "clean": (GOOD, [], 1),
    "empty": ("", [], 0),
    "no newline at the end": (GOOD.rstrip(), [], 1),
    "full image": ("1 0.5 0.5 1 1\n", [], 1),
    "short forms": ("0 .5 0.5 +0.2 1.\n", [], 1),
    # repaired
    "windows": (GOOD.replace("\n", "\r\n") * 2, [(1, "crlf"), (2, "near_duplicate")], 2),
    "windows from line 2": (GOOD + "1 0.5 0.5 0.1 0.1\r\n", [(2, "crlf")], 2),
    "byte order mark": (b"\xef\xbb\xbf" + GOOD.encode(), [(1, "bom")], 1),
    "trailing blank": ("0 0.5 0.5 0.2 0.1 \n", [(1, "stray_blanks")], 1),
    "trailing tab": (GOOD + "1 0.5 0.5 0.1 0.1\t\n", [(2, "stray_blanks")], 2),
    "leading blank": (" 0 0.5 0.5 0.2 0.1\n", [(1, "stray_blanks")], 1),
    "tabs": ("0\t0.5\t0.5\t0.2\t0.1\n", [(1, "stray_blanks")], 1),
    "blank line": (GOOD + "\n1 0.5 0.5 0.1 0.1\n", [(2, "stray_blanks")], 2),
    "only a blank line": ("\n", [(1, "stray_blanks")], 0),
    "float class": ("0.0 0.5 0.5 0.2 0.1\n", [(1, "float_class")], 1),
    "float class, no digits": ("1. 0.5 0.5 0.2 0.1\n", [(1, "float_class")], 1),
    "scientific": ("0 5e-1 0.5 2E-1 0.1\n", [(1, "scientific_notation")] * 2, 1),
    "overrun by rounding": ("0 0.133333 0.3 0.266667 0.2\n", [(1, "small_overrun")], 1),
    "overrun by 0.4 px": ("0 0.0996 0.5 0.2 0.1\n", [(1, "small_overrun")], 1),
    "overrun by 0.4 px below": ("0 0.5 0.9508 0.2 0.1\n", [(1, "small_overrun")], 1),
    # listed
    "exact duplicate": (GOOD + GOOD, [(2, "near_duplicate")], 2),
    "near duplicate": (GOOD + "0 0.501 0.5 0.2 0.1\n", [(2, "near_duplicate")], 2),
    "same place, other class": (GOOD + "1" + GOOD[1:], [], 2),
    "overlap of 0.9": (GOOD + "0 0.51 0.5 0.2 0.1\n", [], 2),
    "subpixel width": ("0 0.5 0.5 0.0009 0.1\n", [(1, "subpixel_box")], 1),
    "subpixel height": ("0 0.5 0.5 0.1 0.0019\n", [(1, "subpixel_box")], 1),
    # refused
    "nan": ("0 nan 0.5 0.2 0.1\n", [(1, "not_finite")], 0),
    "infinity": ("0 0.5 0.5 -Infinity 0.1\n", [(1, "not_finite")], 0),
    "overflow": ("0 0.5 0.5 1e999 0.1\n", [(1, "not_finite"), (1, "scientific_notation")], 0),
    "zero width": ("0 0.5 0.5 0 0.1\n", [(1, "no_extent")], 0),
    "negative height": (GOOD + "0 0.5 0.5 0.2 -0.1\n", [(2, "no_extent")], 1),
    "pixels": ("0 512 300 80 40\n", [(1, "pixel_units")], 0),
    "one pixel value": ("0 0.5 0.5 80 0.1\n", [(1, "pixel_units")], 0),
    "class off the map": ("2 0.5 0.5 0.2 0.1\n", [(1, "unknown_class")], 0),
    "negative class": ("-1 0.5 0.5 0.2 0.1\n", [(1, "unknown_class")], 0),
    "fractional class": ("0.5 0.5 0.5 0.2 0.1\n", [(1, "unknown_class")], 0),
    "class by name": ("positive 0.5 0.5 0.2 0.1\n", [(1, "unknown_class")], 0),
    "overrun by 0.6 px": ("0 0.0994 0.5 0.2 0.1\n", [(1, "overrun")], 0),
    "overrun by 0.6 px above": ("0 0.5 0.0488 0.2 0.1\n", [(1, "overrun")], 0),
    "centre outside": ("0 1.2 0.5 0.2 0.1\n", [(1, "overrun")], 0),
    "confidence": ("0 0.5 0.5 0.2 0.1 0.93\n", [(1, "field_count")], 0),
    "too few": (GOOD + "0 0.5 0.5 0.2\n", [(2, "field_count")], 1),
    "polygon": ("0 0.1 0.1 0.4 0.1 0.4 0.5\n", [(1, "field_count")], 0),
    "commas between": ("0,0.5,0.5,0.2,0.1\n", [(1, "field_count")], 0),
    "decimal comma": ("0 0,5 0.5 0.2 0.1\n", [(1, "not_a_number")], 0),
    "underscore": ("0 0.5 0.5 0.2 0.1_0\n", [(1, "not_a_number")], 0),
    "hexadecimal": ("0 0x1 0.5 0.2 0.1\n", [(1, "not_a_number")], 0),
    "other digits": ("0 0.٥ 0.5 0.2 0.1\n", [(1, "not_a_number")], 0),
    "comment": ("# reviewed by AB\n", [(1, "field_count")], 0),
    "utf-16": (GOOD.encode("utf-16"), [(1, "not_text")], 0),
    "latin-1": (GOOD.encode() + b"\xe4\n", [(2, "not_text")], 0),
    "image": (b"\xff\xd8\xff\xe0", [(1, "not_text")], 0),
    "two wrongs in a line": ("7 nan 0.5 0.2 0.1\n", [(1, "not_finite"), (1, "unknown_class")], 0),
    "wrongs in two lines": (
        "7 0.5 0.5 0.2 0.1\n0 0.5 0.5 0.2 0\n",
        [(1, "unknown_class"), (2, "no_extent")],
        0,
    ),
}


@pytest.mark.parametrize("name", CORPUS)
def test_corpus(tmp_path, name):
    content, wanted, left = CORPUS[name]
    boxes, issues = read(tmp_path, content)
    assert sorted((issue.line, issue.code) for issue in issues) == wanted
    assert len(boxes) == left
    assert {issue.file for issue in issues} <= {"labels/100.txt"}


def test_corpus_holds_every_repair_and_warning_of_a_line():
    found = {code for _, issues, _ in CORPUS.values() for _, code in issues}
    mild = {code for code, severity in SEVERITIES.items() if severity != "error"}
    assert found >= mild - {"unmarked_image"}


def test_values_and_lines_survive(tmp_path):
    boxes, _ = read(tmp_path, "1 0.25 0.5 0.125 0.0625\n\n0 0.5 0.75 0.25 0.5\n")
    assert [(b.name, b.x_center, b.y_center, b.width, b.height, b.line) for b in boxes] == [
        ("negative", 0.25, 0.5, 0.125, 0.0625, 1),
        ("positive", 0.5, 0.75, 0.25, 0.5, 3),
    ]


def test_small_overrun_is_cut_at_the_edge(tmp_path):
    (box,), _ = read(tmp_path, "0 0.0996 0.5 0.2 0.1\n")
    assert box.edges() == pytest.approx((0, 0.45, 0.1996, 0.55), abs=1e-15)


def test_many_boxes(tmp_path):
    lines = "".join(
        f"0 {0.02 * (k % 45) + 0.05:.4f} {0.08 * (k // 45) + 0.05:.4f} 0.01 0.02\n" for k in range(500)
    )
    boxes, issues = read(tmp_path, lines)
    assert (len(boxes), issues) == (500, [])


@settings(max_examples=200, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.floats(0, 1, exclude_min=True), st.floats(0, 1, exclude_min=True))
def test_any_box_is_kept_whole_cut_a_little_or_refused(x, y, width, height):
    from card.annotations.boxes import Box, checked_box

    issues: list = []
    box = checked_box(Box("positive", x, y, width, height, 1), RULES, "file", issues)
    errors = [issue for issue in issues if issue.severity == "error"]
    assert (box is None) == bool(errors)
    if box:
        edges = box.edges()
        assert min(edges) >= -1e-9
        assert max(edges) <= 1 + 1e-9
        # Nothing moved by more than the half pixel that may be cut.
        moved = [
            abs(a - b) for a, b in zip(edges, Box("positive", x, y, width, height, 1).edges(), strict=True)
        ]
        assert max(moved[0::2]) <= 0.0005 + 1e-12
        assert max(moved[1::2]) <= 0.001 + 1e-12


DETECTION = (
    "yolo/obj_train_data",
    "yolov8_detection/labels/train",
    "yolov8_detection_with_list_of_imgs/labels/train",
    "yolov8_detection_with_list_of_names/labels/train",
    "yolov8_detection_with_subset_txt/labels/train",
)


@pytest.mark.parametrize("folder", DETECTION)
def test_reads_detection_labels_of_other_tools(test_data, folder):
    path = test_data / "label_formats" / "yolo_dataset" / folder / "1.txt"
    names = [f"label_{number}" for number in range(10)]
    boxes, issues = read_label_file(path, "1.txt", names, RULES)
    assert [(b.name, b.y_center, b.height) for b in boxes] == [("label_2", 0.3, 0.2), ("label_4", 0.45, 0.3)]
    assert [(issue.line, issue.code) for issue in issues] == [(1, "small_overrun")]


@pytest.mark.parametrize("layout", ["segmentation", "pose", "oriented_boxes", "pose_two_values_per_point"])
def test_refuses_yolo_labels_that_are_not_boxes(test_data, layout):
    path = test_data / "label_formats" / "yolo_dataset" / f"yolov8_{layout}" / "labels" / "train" / "1.txt"
    boxes, issues = read_label_file(path, "1.txt", [f"label_{number}" for number in range(10)], RULES)
    assert boxes == []
    assert {issue.code for issue in issues} == {"field_count"}
