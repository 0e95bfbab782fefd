"""Why the default is one constant: a redacted face must not lead to its neighbours in time or space."""

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[2] / "benchmarks"))

from linkage import PEOPLE, blurred, captures, filled, linked_pct, pixelated


def test_a_constant_fill_links_no_better_than_chance() -> None:
    # All distances are equal: whatever the attacker picks is a guess among a hundred.
    assert linked_pct(filled) <= 100 / PEOPLE
    assert len({filled(face).tobytes() for face in captures()[0]}) == 1


@pytest.mark.parametrize("weaker", [blurred, pixelated])
def test_blur_and_pixelation_give_people_away(weaker) -> None:
    assert linked_pct(weaker) >= 60
