import pytest

from card.errors import CardError
from card.packaging.card_tables import ground_truth_reviews
from card.packaging.reviews import read_reviews

HEADER = "sequence\treviewer\tdate\tverdict\tnote\n"
ACCEPTED = "a\tA. Person\t2026-05-01\taccepted\t-\n"
REJECTED = "a\tA. Person\t2026-04-30\trejected\tghost of a lorry\n"


@pytest.fixture
def sheet(tmp_path):
    def write(*rows: str):
        path = tmp_path / "reviews.tsv"
        path.write_text(HEADER + "".join(rows))
        return path

    return write


def test_the_last_review_of_a_sequence_counts(sheet):
    assert read_reviews(sheet(), {"a"}, {"a"}) == {}
    reviews = read_reviews(sheet(REJECTED, ACCEPTED), {"a", "b"}, {"a", "b"})
    assert reviews["a"]["verdict"] == "accepted"
    assert set(reviews) == {"a"}


def test_a_rejected_sequence_cannot_be_released(sheet):
    with pytest.raises(CardError, match=r"a: ground truth was rejected .found ghost of a lorry"):
        read_reviews(sheet(ACCEPTED, REJECTED), {"a"}, {"a"})
    assert read_reviews(sheet(REJECTED), {"a"}, set())["a"]["verdict"] == "rejected"


@pytest.mark.parametrize(
    ("row", "match"),
    [
        (ACCEPTED.replace("a\t", "c\t", 1), "review of an unknown sequence"),
        (ACCEPTED.replace("accepted", "fine"), "fine"),
        (ACCEPTED.replace("2026-05-01", "1 May"), "1 May"),
        (ACCEPTED.replace("\t-", ""), "wrong number of cells"),
    ],
)
def test_a_bad_row_is_an_error(sheet, row, match):
    with pytest.raises(CardError, match=match):
        read_reviews(sheet(row), {"a"}, {"a"})


def test_the_card_says_what_nobody_has_signed_off():
    frames = [
        {"sequence": "b", "gt_flag": "cut"},
        {"sequence": "a", "gt_flag": "complete"},
        {"sequence": "c", "gt_flag": "complete"},
        {"sequence": "d", "gt_flag": None},
    ]
    review = {"reviewer": "A. Person", "date": "2026-05-01", "verdict": "accepted", "note": "-"}
    lines = ground_truth_reviews(frames, {"a": review, "c": review | {"note": "dust at the start"}})
    assert lines == [
        "- `b`: nobody has signed off the ground truth after looking at it.",
        "- `c`: ground truth accepted by A. Person on 2026-05-01: dust at the start.",
    ]
