"""Drawing the sample that is labelled first, and its splits."""

from collections import Counter
from pathlib import Path

import pytest
from labelling_loop import FRAMES, PROPOSALS, make_loop

from card.annotations.loop.choose import read_frames
from card.annotations.loop.sample import draw_sample, read_sample, split_figures, write_sample
from card.errors import CardError


@pytest.fixture(scope="module")
def work(tmp_path_factory) -> Path:
    return make_loop(tmp_path_factory.mktemp("loop"))


def test_the_sample_is_the_papers_and_can_be_repeated():
    frames = [(f"drive_{k}", frame) for k in range(9) for frame in range(50 + 10 * k)]
    sample = draw_sample(frames, PROPOSALS)
    assert sample == draw_sample(reversed(frames + frames[:3]), PROPOSALS)
    assert sample != draw_sample(frames, PROPOSALS | {"seed": 2})
    seed = [row for row in sample if row.part == "seed"]
    assert len(sample) == len(frames)
    assert len(seed) == round(0.4 * len(frames))
    assert Counter(row.random for row in seed) == {
        "train": round(0.7 * len(seed)),
        "validation": round(0.2 * len(seed)),
        "test": len(seed) - round(0.7 * len(seed)) - round(0.2 * len(seed)),
    }
    assert {(row.random, row.grouped) for row in sample if row.part == "rest"} == {("-", "-")}


def test_grouped_splits_keep_sequences_whole_and_near_their_shares():
    frames = [(f"drive_{k}", frame) for k in range(30) for frame in range(40 + 5 * k)]
    sample = draw_sample(frames, PROPOSALS)
    seed = [row for row in sample if row.part == "seed"]
    for k in range(30):
        assert len({row.grouped for row in seed if row.sequence == f"drive_{k}"}) == 1
    shares = Counter(row.grouped for row in seed)
    assert shares["train"] / len(seed) == pytest.approx(0.7, abs=0.03)
    assert shares["validation"] / len(seed) == pytest.approx(0.2, abs=0.03)
    figures = split_figures(sample, 10)
    assert figures["grouped"]["near_pct"] == 0
    assert figures["random"]["near_pct"] > 95
    assert figures["random"]["train_frames"] == round(0.7 * len(seed))
    assert figures["grouped"]["train_sequences"] < 30 == figures["random"]["train_sequences"]


def test_a_drawn_sample_is_not_drawn_over(work, tmp_path):
    path = tmp_path / "sample.tsv"
    sample = read_sample(work / "sample.tsv")
    write_sample(path, sample)
    assert path.read_bytes() == (work / "sample.tsv").read_bytes()
    write_sample(path, sample)
    with pytest.raises(CardError, match="another sample was drawn before"):
        write_sample(path, sample[1:])


def test_a_listed_frame_must_be_there(work, tmp_path):
    (tmp_path / "list.tsv").write_text(f"sequence\tframe\ndrive_a\t3\ndrive_a\t{FRAMES}\n")
    with pytest.raises(CardError, match=r"list.tsv: unknown frame \(found drive_a 20\)"):
        read_frames(tmp_path / "list.tsv", work / "results")
