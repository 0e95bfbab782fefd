"""Which frames people label first, and how these are split for the detector that proposes the rest."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from card.artifacts import atomic_file, check, read_sheet
from card.errors import CardError

SCHEMA = "annotation_sample"
SEED, REST = "seed", "rest"
TRAIN, VALIDATION, TEST, NONE = "train", "validation", "test", "-"
SPLITS = (TRAIN, VALIDATION, TEST)
WAYS = ("random", "grouped")
"""Of splitting the seed: frame by frame as in the paper, and whole sequences."""


@dataclass(frozen=True, order=True)
class Sampled:
    """A frame with irregularities, labelled by people or of the rest; its splits, there `NONE`."""

    sequence: str
    frame: int
    part: str
    random: str
    grouped: str


def draw_sample(frames: Iterable[tuple[str, int]], settings: Mapping[str, Any]) -> list[Sampled]:
    """Sample the seed and split it both ways; ordered by sequence and frame.

    frames : (sequence, frame) of all frames with irregularities, in any order.
    settings : ``seed``, ``seed_share``, ``train_share``, ``validation_share`` as in ``settings/proposals``.

    The draw depends on the seed and on names and numbers alone, so it can be repeated anywhere.
    """
    known = sorted(set(frames))
    number = settings["seed"]
    seeds = _ranked(known, f"{number} seed")[: round(settings["seed_share"] * len(known))]
    random = _split_frames(_ranked(seeds, f"{number} split"), settings)
    grouped = _split_sequences(seeds, f"{number} groups", settings)
    return [
        Sampled(
            sequence,
            frame,
            SEED if (sequence, frame) in random else REST,
            random.get((sequence, frame), NONE),
            grouped[sequence] if (sequence, frame) in random else NONE,
        )
        for sequence, frame in known
    ]


def _ranked(frames: Iterable[tuple[str, int]], salt: str) -> list[tuple[str, int]]:
    return sorted(frames, key=lambda frame: _hash(f"{salt} {frame[0]} {frame[1]}"))


def _hash(text: str) -> str:
    return sha256(text.encode()).hexdigest()


def _split_frames(
    ranked: Sequence[tuple[str, int]], settings: Mapping[str, Any]
) -> dict[tuple[str, int], str]:
    train = round(settings["train_share"] * len(ranked))
    validation = round(settings["validation_share"] * len(ranked))
    splits = [TRAIN] * train + [VALIDATION] * validation + [TEST] * len(ranked)
    return dict(zip(ranked, splits, strict=False))


def _split_sequences(
    seeds: Sequence[tuple[str, int]], salt: str, settings: Mapping[str, Any]
) -> dict[str, str]:
    """The largest sequence first, each to the split that misses most of its share."""
    sizes = Counter(sequence for sequence, _ in seeds)
    train, validation = settings["train_share"], settings["validation_share"]
    missing = {TRAIN: train, VALIDATION: validation, TEST: 1 - train - validation}
    missing = {name: share * len(seeds) for name, share in missing.items()}
    splits = {}
    for sequence in sorted(sizes, key=lambda name: (-sizes[name], _hash(f"{salt} {name}"))):
        splits[sequence] = max(SPLITS, key=lambda name: missing[name])
        missing[splits[sequence]] -= sizes[sequence]
    return splits


def split_figures(sample: Sequence[Sampled], near_frames: int) -> dict[str, dict[str, float]]:
    """What each way of splitting gives, by way: frames and sequences of each split, and ``near_pct``.

    ``near_pct`` is the share (%) of the validation and test frames that have a train frame of their sequence
    no more than ``near_frames`` away: what the detector has as good as seen.
    """
    figures: dict[str, dict[str, float]] = {}
    seeds = [row for row in sample if row.part == SEED]
    for way in WAYS:
        split = {(row.sequence, row.frame): getattr(row, way) for row in seeds}
        held = [key for key, name in split.items() if name != TRAIN]
        reach = range(-near_frames, near_frames + 1)
        near = [any(split.get((s, f + step)) == TRAIN for step in reach) for s, f in held]
        figures[way] = {
            **{f"{name}_frames": sum(one == name for one in split.values()) for name in SPLITS},
            **{
                f"{name}_sequences": len({k[0] for k, one in split.items() if one == name}) for name in SPLITS
            },
            "near_pct": 100 * sum(near) / len(near) if near else 0.0,
        }
    return figures


def write_sample(path: Path, sample: Sequence[Sampled]) -> None:
    """Write the sheet. CardError if another sample is there: what was drawn once stays, or its labels lie."""
    rows = [{name: str(value) for name, value in asdict(row).items()} for row in sample]
    for number, row in enumerate(rows, 2):
        check(row, SCHEMA, f"{path}:{number}")
    names = list(Sampled.__dataclass_fields__)
    text = "".join("\t".join(cells) + "\n" for cells in [names, *(row.values() for row in rows)])
    if path.is_file() and path.read_text(encoding="utf-8") != text:
        raise CardError(
            "another sample was drawn before", where=path, wanted="to keep it, or to take the file away first"
        )
    with atomic_file(path) as partial:
        partial.write_text(text, encoding="utf-8")


def read_sample(path: Path) -> list[Sampled]:
    """The sheet's rows."""
    return [Sampled(**row | {"frame": int(row["frame"])}) for row in read_sheet(path, SCHEMA)]  # type: ignore[arg-type]
