"""A reviewer's additions and clearances."""

import pytest

from card.errors import CardError
from card.privacy.detection import Detection
from card.privacy.review import check_images, read_reviews, reviewed

HEADER = "camera,t_ns,action,kind,x_min,y_min,x_max,y_max,reason\n"
IMAGE = ("camera_left", 100)


def box(x: float, kind: str = "face") -> Detection:
    return Detection(kind, x, 10, x + 10, 20, score=1, source="m", model_sha256="")


@pytest.fixture
def review(tmp_path):
    def write(*lines: str):
        path = tmp_path / "privacy_review.csv"
        path.write_text(HEADER + "".join(f"{line}\n" for line in lines))
        return path

    return write


def test_adds_and_clears_by_place_and_kind(review):
    lines = read_reviews(
        review(
            "camera_left,100,clear,face,9,9,21,21,a poster",
            'camera_left,100,add,plate,40,1,50,5,"far, small"',
        )
    )[IMAGE]
    kept = reviewed([box(10), box(10, "plate"), box(15)], lines, "image")
    assert [(d.kind, d.x_min, d.source) for d in kept] == [
        ("plate", 10, "m"),
        ("face", 15, "m"),
        ("plate", 40, "review"),
    ]


def test_clearing_nothing_is_an_error(review):
    lines = read_reviews(review("camera_left,100,clear,face,50,9,70,21,a poster"))[IMAGE]
    with pytest.raises(CardError, match="nothing to clear in line 2"):
        reviewed([box(10)], lines, "image")


def test_an_image_nobody_has_is_an_error(review):
    path = review("camera_left,101,add,face,50,9,70,21,missed")
    with pytest.raises(CardError, match=r"privacy_review.csv:2: reviewed image is not in the frames"):
        check_images(read_reviews(path), {IMAGE}, path)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("camera_left,100,hide,face,1,1,2,2,why", ":2: unknown action"),
        ("camera_left,100,add,dog,1,1,2,2,why", ":2: unknown kind"),
        ("camera_left,100,add,face,1,1,2,2, ", ":2: no reason"),
        ("camera_left,100,add,face,1,1,2,2", ":2: row does not fit"),
        ("camera_left,100,add,face,3,1,2,2,why", ":2: box without an extent"),
        ("camera_left,100,add,face,nan,1,2,2,why", ":2: box without an extent"),
        ("camera_left,100,add,face,x,1,2,2,why", ":2: edge is no number"),
        ("camera_left,1e2,add,face,1,1,2,2,why", ":2: t_ns is no integer"),
    ],
)
def test_bad_lines_are_named(review, line, message):
    with pytest.raises(CardError, match=f"privacy_review.csv{message}"):
        read_reviews(review(line))


def test_another_header_is_an_error(tmp_path):
    path = tmp_path / "privacy_review.csv"
    path.write_text("camera,t_ns\n")
    with pytest.raises(CardError, match="wrong columns"):
        read_reviews(path)
