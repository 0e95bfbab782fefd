"""The choice of splits: shares, strata, groups, frozen rows."""

import logging
from collections import Counter
from itertools import pairwise

import pytest
from splits_drives import SETTINGS, drive, drives

from card.splits.extend import choose
from card.splits.first import deviation, first_assignment
from card.splits.groups import make_groups
from card.splits.later import later_assignment
from card.splits.ledger import Row

TARGETS = (("train", 0.6), ("validation", 0.2), ("test", 0.2))
OLD = Row("old", 0, None, "validation", "none/town", "old")


def old_rows(names: list[str], split: str = "train") -> list[Row]:
    return [Row(name, 0, None, split, "none/town", name) for name in names]


def share(rows: list[Row], split: str) -> float:
    return sum(row.split == split for row in rows) / len(rows)


def test_shares_reach_their_targets_overall_and_in_each_stratum() -> None:
    new = drives(50) + drives(50, "positive/town") + drives(20, "negative/town")
    rows = choose([], new, SETTINGS)
    for stratum in ("none/town", "positive/town", "negative/town"):
        inside = [row for row in rows if row.stratum == stratum]
        for split, target in TARGETS:
            assert abs(share(inside, split) - target) <= 1.01 / len(inside)


def test_the_first_assignment_is_no_worse_than_one_by_one() -> None:
    new = [
        drive(f"d{index:02d}", f"{kind}/p{index % 4}", seconds=20 + 37 * index % 90)
        for index in range(40)
        for kind in [("none", "positive", "negative")[index % 3]]
    ]
    groups = make_groups(new, SETTINGS | {"guard_gap_s": 0})
    first = first_assignment(groups, SETTINGS)
    assert first is not None
    assert first == first_assignment(groups, SETTINGS)
    greedy = later_assignment(groups, SETTINGS)
    assert deviation(groups, first, SETTINGS) < deviation(groups, greedy, SETTINGS)


def test_four_drives_of_four_strata_fill_all_splits() -> None:
    new = [drives(1, name)[0] for name in ("aaa/x", "bbb/x", "ccc/x", "ddd/x")]
    assert sorted(row.split for row in choose([], new, SETTINGS)) == ["test", "train", "train", "validation"]


def test_new_drives_make_up_for_what_old_rows_left() -> None:
    known = old_rows([f"non{index:03d}" for index in range(6)])
    rows = choose(known, drives(10), SETTINGS)
    assert {row.sequence for row in rows} == {f"non{index:03d}" for index in range(6, 10)}
    assert sorted(row.split for row in rows) == ["test", "test", "validation", "validation"]


def test_the_order_of_the_sheet_does_not_matter() -> None:
    new = drives(20) + drives(7, "positive/town", seconds=15)
    assert choose([], new, SETTINGS) == choose([], new[::-1], SETTINGS)


def test_tracks_that_come_close_share_a_group_and_a_split() -> None:
    new = [drive(f"a{index}", start=(0, 4.0 * index)) for index in range(3)]
    new += [drive(f"b{index}", start=(0, 500 + 50.0 * index)) for index in range(9)]
    rows = {row.sequence: row for row in choose([], new, SETTINGS)}
    assert {rows[f"a{index}"].group for index in range(3)} == {"a0"}
    assert len({rows[f"a{index}"].split for index in range(3)}) == 1
    assert len({rows[f"b{index}"].group for index in range(9)}) == 9


def test_tracks_in_maps_of_their_own_are_not_compared() -> None:
    new = [drive(f"a{index}", start=(0, 0), map_name=f"a{index}") for index in range(5)]
    assert len({row.group for row in choose([], new, SETTINGS)}) == 5


def test_a_stratum_with_too_few_groups_is_cut_into_blocks_with_gaps() -> None:
    rows = choose([], [drive("only", seconds=400, start=(0, 0))], SETTINGS)
    assert {row.split for row in rows} == {"train", "validation", "test"}
    assert rows[-1].last is None
    for before, after in pairwise(rows):
        assert before.last is not None
        assert (after.first - before.last) / 10 >= SETTINGS["guard_gap_s"]
        assert 20 <= (before.last - before.first) / 10 + 0.2 <= 30.2
    covered = sum((400 if row.last is None else row.last / 10) - row.first / 10 for row in rows)
    assert covered > 0.8 * 400
    assert len({row.group for row in rows}) == len(rows)


@pytest.mark.parametrize(("seconds", "blocks"), [(20, 1), (44, 1), (45, 2), (66, 2), (100, 3), (400, 12)])
def test_blocks_keep_their_lengths(seconds: float, blocks: int) -> None:
    assert len(choose([], [drive("only", seconds=seconds)], SETTINGS)) == blocks


def test_blocks_of_a_drive_that_comes_back_stay_together() -> None:
    there_and_back = drive("loop", seconds=200, start=(0, 0))
    assert there_and_back.track is not None
    there_and_back.track.places_m[1000:, 0] = there_and_back.track.places_m[1000::-1, 0]
    rows = choose([], [there_and_back], SETTINGS)
    first = {row.group for row in rows if row.first < 200}
    last = {row.group for row in rows if row.first > 1700}
    assert first == last


def test_a_stratum_with_old_groups_enough_is_not_cut() -> None:
    known = [drive(f"old{index}") for index in range(3)]
    rows = choose(old_rows([item.id for item in known]), [*known, drive("new", seconds=400)], SETTINGS)
    assert [(row.first, row.last) for row in rows] == [(0, None)]


def test_zero_shot_drives_are_reserved_first_and_their_neighbours_are_not_trained_on() -> None:
    new = [drive("zero", role="zero_shot", start=(0, 0)), drive("beside", start=(100, 5))]
    new += [drive(f"far{index}", start=(0, 1000 + 100.0 * index)) for index in range(6)]
    rows = {row.sequence: row for row in choose([], new, SETTINGS)}
    assert (rows["zero"].split, rows["zero"].last) == ("zero_shot", None)
    assert rows["beside"].split == "test"


def test_a_new_drive_beside_old_rows_takes_their_split() -> None:
    known = [drive("old", start=(0, 0)), drive("older", start=(0, 200))]
    rows = [OLD, *old_rows(["older"])]
    (row,) = choose(rows, [*known, drive("new", start=(50, 3))], SETTINGS)
    assert (row.split, row.group) == ("validation", "old")


def test_a_new_drive_between_two_splits_stays_out(caplog: pytest.LogCaptureFixture) -> None:
    known = [drive("old", start=(0, 0)), drive("older", start=(0, 12))]
    new = drive("new", start=(0, 6))
    with caplog.at_level(logging.WARNING, "card"):
        assert choose([OLD, *old_rows(["older"])], [*known, new], SETTINGS) == []
    assert "new: close to rows of train, validation; left unassigned" in caplog.text


def test_frame_mode_assigns_every_sampled_frame_by_itself() -> None:
    new = [*drives(3, seconds=100), drive("zero", role="zero_shot")]
    rows = choose([], new, SETTINGS | {"mode": "frame"})
    frames = Counter()
    for row in rows:
        if row.split != "zero_shot":
            assert row.last is not None
            frames[row.split] += (row.last - row.first) // 3 + 1
    assert frames.total() == 3 * 334
    for split, target in TARGETS:
        assert abs(frames[split] / frames.total() - target) < 0.001
    assert [row.sequence for row in rows if row.split == "zero_shot"] == ["zero"]
    assert len(rows) > 300  # neighbours part
    assert rows == choose([], new, SETTINGS | {"mode": "frame"})
    later = choose(rows, [*new, drive("later", seconds=100)], SETTINGS | {"mode": "frame"})
    assert {row.sequence for row in later} == {"later"}


def test_frames_of_several_strata_count_for_each() -> None:
    mixed = ("none/town",) * 150 + ("positive/town",) * 151
    new = [drive(f"m{index:02d}", strata=mixed) for index in range(10)]
    rows = choose([], new, SETTINGS)
    assert sorted(Counter(row.split for row in rows).values()) == [2, 2, 6]
    assert {row.stratum for row in rows} == {"positive/town"}
