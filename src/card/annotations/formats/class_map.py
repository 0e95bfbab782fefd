"""The class map that the label tool saved, against the pinned one."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from card.annotations.formats.text import read_lines
from card.annotations.issues import Issue

# labelImg writes its map into the folder of the labels.
PLACES = ("classes.txt", "labels/classes.txt")


def check_class_map(annotations: Path, classes: Sequence[str]) -> list[Issue]:
    """An error unless each map says just what ``classes``, in the order of their ids, says.

    A label tool that saves a subset of the names renumbers them, and ids alone do not show it.
    """
    issues: list[Issue] = []
    there = [place for place in PLACES if (annotations / place).is_file()]
    if not there:
        return [Issue(PLACES[0], 0, "class_map", f"file is missing, wanted {', '.join(classes)}")]
    for place in there:
        lines = [line.strip() for line in read_lines(annotations / place, place, issues)]
        while lines and not lines[-1]:
            lines.pop()
        for number, (found, wanted) in enumerate(zip_longest(lines, classes), 1):
            if found != wanted:
                message = f"found {found or 'nothing'}, wanted {wanted or 'no more'}"
                issues.append(Issue(place, number, "class_map", message))
                break
    return issues
