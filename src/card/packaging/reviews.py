"""The sheet in which people sign off the ground truth of sequences after looking at it."""

from collections.abc import Collection
from pathlib import Path

from card.artifacts import read_sheet
from card.errors import CardError

Review = dict[str, str]


def read_reviews(path: Path, sequences: Collection[str], released: Collection[str]) -> dict[str, Review]:
    """The last review of each sequence, rows of schema ``ground_truth_reviews``.

    Parameters
    ----------
    sequences : ids of the sequence sheet. released : those that would be released.

    Raises
    ------
    CardError
        For a row that does not fit, an unknown sequence, or one that was rejected and would be released.
    """
    reviews: dict[str, Review] = {}
    for row in read_sheet(path, "ground_truth_reviews"):
        if row["sequence"] not in sequences:
            raise CardError("review of an unknown sequence", where=path, found=row["sequence"])
        reviews[row["sequence"]] = row
    for name, row in reviews.items():
        if row["verdict"] == "rejected" and name in released:
            raise CardError(
                "ground truth was rejected",
                where=f"{path}, {name}",
                found=row["note"],
                wanted="quarantine in the sequence sheet, or a later review that accepts it",
            )
    return reviews
