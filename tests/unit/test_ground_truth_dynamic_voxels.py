"""What makes a voxel dynamic, once sweeps have voted."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from card.artifacts import default_settings
from card.ground_truth.dynamic_voxels import (
    accompanied,
    attached,
    contradicted,
    is_brief,
    lone,
    looked_through,
    seldom_hit,
    surrounded,
    vacated,
)
from card.ground_truth.reference.attached import attached as plain_attached
from card.ground_truth.reference.attached import surrounded as plain_surrounded
from card.ground_truth.visibility_votes import Votes
from card.ground_truth.voxels import pack

SETTINGS = default_settings("ground_truth")
S_NS = 1_000_000_000


def votes(**given: list[int]) -> Votes:
    count = len(next(iter(given.values())))
    names = ("hits", "beside", "moved", "elsewhen", "moved_elsewhen")
    return Votes(*(np.array(given.get(name, [0] * count), dtype=np.int32) for name in names))


def test_contradiction_may_be_larger_where_quotas_are_met():
    some = votes(hits=[3, 3, 0, 9], beside=[1, 1, 0, 0], moved=[2, 2, 1, 2])
    assert some.comparisons.tolist() == [6, 6, 1, 11]
    met = np.array([True, False, False, False])
    assert contradicted(some, met, SETTINGS).tolist() == [False, True, False, False]


def test_a_voxel_is_seldom_hit_if_most_sweeps_look_past_it():
    some = votes(hits=[1, 1, 1, 2, 0], beside=[6, 7, 5, 13, 6], moved=[2, 1, 2, 2, 2])
    assert seldom_hit(some, SETTINGS).tolist() == [True, False, False, False, True]
    assert not seldom_hit(some, SETTINGS | {"passes_per_hit": 0}).any()


def test_a_lone_voxel_takes_more_contradiction():
    keys = cube(50, 2)
    some = votes(hits=[6] * 8, moved=[4] * 8)
    few, many = np.arange(8) < 3, np.arange(8) < 4
    assert lone(keys, few, some, SETTINGS).tolist() == few.tolist()
    assert not lone(keys, many, some, SETTINGS).any()
    assert not lone(keys, few, votes(hits=[6] * 8, moved=[5] * 8), SETTINGS).any()
    assert not lone(keys, few, some, SETTINGS | {"moved_fraction_lone": 0}).any()


def test_a_voxel_among_dynamic_ones_takes_less():
    keys = cube(50, 3)
    dynamic = np.arange(27) >= 15
    some = votes(hits=[9] * 27, beside=[9, 8, 9] * 9, moved=[2, 2, 1] * 9)
    found = accompanied(keys, dynamic, some, SETTINGS)
    assert found.tolist() == [True, True, False] * 9
    assert not accompanied(keys, np.arange(27) >= 16, some, SETTINGS).any()
    assert not accompanied(keys, dynamic, some, SETTINGS | {"accompanied_voxels": 0}).any()


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(0, 6)] * 3, st.booleans()), max_size=80, unique_by=lambda v: v[:3]),
    st.integers(0, 5),
    st.sampled_from([1, 2]),
)
def test_company_is_counted_as_over_all_pairs(voxels, company, radius):
    table = np.array(sorted(voxels), dtype=np.int64).reshape(-1, 4)
    keys, dynamic = pack(table[:, :3] + 50), table[:, 3] > 0
    close = np.abs(table[:, None, :3] - table[:, :3]).max(axis=2, initial=0) <= radius
    count = (close & dynamic).sum(axis=1)
    some = votes(hits=[8] * len(keys), moved=[2] * len(keys)) if len(keys) else votes(hits=[])
    filled = SETTINGS | {"near_voxels": radius, "lone_voxels": company, "accompanied_voxels": company + 1}
    assert np.array_equal(lone(keys, dynamic, some, filled), dynamic & (count - 1 <= company))
    assert np.array_equal(accompanied(keys, dynamic, some, filled), count > company)


def test_what_stood_for_long_and_is_gone_is_dynamic():
    some = votes(hits=[60] * 3, moved=[9, 6, 6], elsewhen=[5, 12, 13], moved_elsewhen=[5, 6, 6])
    assert not contradicted(some, np.zeros(3, bool), SETTINGS).any()
    assert vacated(some, SETTINGS).tolist() == [False, True, False]
    assert not vacated(some, SETTINGS | {"vacated_votes": 0}).any()


def test_a_brief_voxel_that_is_looked_through_at_other_times_is_dynamic():
    first = np.array([0, 0, 5 * S_NS])
    last = first + np.array([4, 5, 0]) * 100_000_000
    brief = is_brief((first, last), SETTINGS)
    assert brief.tolist() == [True, False, True]
    some = votes(hits=[1, 1, 1], beside=[5, 8, 4], elsewhen=[6, 9, 5], moved_elsewhen=[1, 1, 1])
    assert looked_through(some, brief, SETTINGS).tolist() == [True, False, False]
    never_moved = votes(elsewhen=[9, 9, 9])
    assert not looked_through(never_moved, brief, SETTINGS).any()
    assert not looked_through(some, brief, SETTINGS | {"brief_looks": 0}).any()


def cube(first: int, edge: int) -> np.ndarray:
    """Keys of a solid cube of voxels."""
    axis = np.arange(first, first + edge)
    return pack(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3))


def row_of_voxels(dynamic: list[int], seconds: list[float]) -> tuple:
    """Voxels side by side along z, each hit at one instant."""
    count = len(dynamic)
    keys = pack(np.stack([np.full(count, 9), np.full(count, 9), 9 + np.arange(count)], axis=1))
    at = (np.array(seconds) * S_NS).astype(np.int64)
    return keys, np.array(dynamic, bool), np.ones(count, bool), (at, at)


def test_what_is_hit_together_with_dynamic_voxels_joins_them_one_after_the_other():
    keys, dynamic, brief, hit = row_of_voxels([1, 1, 0, 0, 0, 0], [0, 0, 0.1, 0.1, 0.2, 0.9])
    assert attached(keys, dynamic, brief, hit, SETTINGS).tolist() == [True] * 5 + [False]
    brief[3] = False
    assert attached(keys, dynamic, brief, hit, SETTINGS).tolist() == [True] * 3 + [False] * 3
    assert attached(keys, dynamic, brief, hit, SETTINGS | {"attached_voxels": 0}).sum() == 2
    assert dynamic.sum() == 2


@settings(max_examples=80, deadline=None)
@given(
    st.lists(
        st.tuples(
            *[st.integers(0, 7)] * 3, st.booleans(), st.booleans(), st.integers(0, 9), st.integers(0, 3)
        ),
        min_size=0,
        max_size=80,
        unique_by=lambda voxel: voxel[:3],
    ),
    st.integers(1, 4),
    st.sampled_from([1, 2]),
)
def test_attached_voxels_are_those_of_the_plain_rounds(voxels, least, radius):
    table = np.array(sorted(voxels), dtype=np.int64).reshape(-1, 7)
    keys, dynamic, brief = pack(table[:, :3] + 50), table[:, 3] > 0, table[:, 4] > 0
    hit = table[:, 5] * 100_000_000, (table[:, 5] + table[:, 6]) * 100_000_000
    filled = SETTINGS | {"attached_voxels": least, "near_voxels": radius}
    found = attached(keys, dynamic, brief, hit, filled)
    assert np.array_equal(found, plain_attached(keys, dynamic, brief, hit, filled))
    assert not (found & ~dynamic & ~brief).any()


def test_what_dynamic_voxels_surround_joins_them():
    block = np.stack(np.meshgrid(*[np.arange(20, 23)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    far = np.array([[23, 21, 21], [60, 21, 21]])
    keys = pack(np.concatenate([block, far]))
    dynamic = np.r_[np.ones(27, bool), False, False]
    dynamic[13] = False
    assert surrounded(keys, dynamic, SETTINGS).tolist() == [True] * 28 + [False]
    assert surrounded(keys, dynamic, SETTINGS | {"surrounded_share": 0}).sum() == 26
    # One of two, or of three in a row.
    pair = pack(np.array([[30, 21, 21], [31, 21, 21], [50, 21, 21], [52, 21, 21], [54, 21, 21]]))
    assert surrounded(pair, np.arange(5) % 2 == 0, SETTINGS).tolist() == [True] * 5
    assert surrounded(pair, np.arange(5) == 2, SETTINGS).tolist() == [False, False, True, False, False]
    # A thin layer over a road of which it is the smaller part stays as it is.
    road = np.stack(np.meshgrid(np.arange(20, 29), np.arange(20, 29), [20, 21], indexing="ij"), axis=-1)
    cells = np.concatenate([road.reshape(-1, 3), [[24, 24, 22], [24, 25, 22], [25, 24, 22]]])
    keys = np.sort(pack(cells))
    above = np.isin(keys, pack(cells[-3:]))
    assert surrounded(keys, above, SETTINGS).sum() == 3


@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.tuples(*[st.integers(0, 5)] * 3, st.booleans()), max_size=80, unique_by=lambda v: v[:3]),
    st.sampled_from([1, 2]),
    st.sampled_from([0.3, 0.5, 0.8, 1.0]),
)
def test_surrounded_voxels_are_those_of_the_plain_rounds(voxels, radius, share):
    table = np.array(sorted(voxels), dtype=np.int64).reshape(-1, 4)
    keys, dynamic = pack(table[:, :3] + 50), table[:, 3] > 0
    filled = SETTINGS | {"near_voxels": radius, "surrounded_share": share}
    assert np.array_equal(surrounded(keys, dynamic, filled), plain_surrounded(keys, dynamic, filled))
