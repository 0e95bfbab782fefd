"""What people made of the proposals: accepted, moved, deleted, added."""

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.annotations.consistency.scene import overlaps
from card.annotations.loop.sample import REST
from card.artifacts import Figure, read_json, read_table, write_report, write_table

Array = NDArray[np.float64]
ACCEPTED, MOVED, DELETED, ADDED = OUTCOMES = ("accepted", "moved", "deleted", "added")


def review_proposals(
    *,
    detections: Path,
    detections_report: Path,
    labels: Path,
    label_states: Path,
    ingest_report: Path,
    rows: Sequence[Mapping[str, Any]],
    review: Path,
    report: Path,
    settings: Mapping[str, Any],
    gates: Sequence[Mapping[str, Any]],
) -> None:
    """Compare the proposals of a sequence with the labels that came back, frame by reviewed frame.

    Parameters
    ----------
    detections : table of this name; those from ``proposal_confidence`` on were proposed.
    detections_report : its report, which carries the hashes of model and sample on.
    labels, label_states, ingest_report : as imported. rows : rows of the sample of this sequence, as dicts.
    review : table ``proposal_review`` to write.
    """
    counts = read_json(ingest_report, "report")["counts"]
    size = np.array([counts["camera_left_width_px"], counts["camera_left_height_px"]] * 2)
    states = {r["frame"]: r["state"] for r in read_table(label_states, "label_states").to_pylist()}
    rest = [row["frame"] for row in rows if row["part"] == REST]
    reviewed = [frame for frame in rest if states.get(frame, "not_reviewed") != "not_reviewed"]
    offered = _by_frame(
        row
        for row in read_table(detections, "detections").to_pylist()
        if row["confidence"] >= settings["proposal_confidence"]
    )
    drawn = _by_frame(read_table(labels, "labels").to_pylist())
    found = [
        {"frame": frame, **line}
        for frame in sorted(reviewed)
        for line in compare(offered.get(frame, []), drawn.get(frame, []), size, settings)
    ]
    names = ("frame", "outcome", "class", "proposal", "label", "confidence", "iou", "moved_px")
    write_table(review, {name: [line[name] for line in found] for name in names}, "proposal_review")
    tally = Counter(line["outcome"] for line in found)
    kept = tally[ACCEPTED] + tally[MOVED]
    write_report(
        report,
        stage="proposal_review",
        sequence=report.parents[1].name,
        settings=settings,
        inputs={"detections": detections, "detections_report": detections_report, "labels": labels},
        counts={
            "frames_rest": len(rest),
            "frames_reviewed": len(reviewed),
            **{outcome: tally[outcome] for outcome in OUTCOMES},
        },
        figures=[
            _share("accepted_pct", tally[ACCEPTED], kept + tally[DELETED], "the proposals, as they were"),
            _share("moved_pct", tally[MOVED], kept + tally[DELETED], "the proposals, drawn anew"),
            _share("deleted_pct", tally[DELETED], kept + tally[DELETED], "the proposals, of nothing"),
            _share("added_pct", tally[ADDED], kept + tally[ADDED], "the labels, not proposed"),
        ],
        gates=gates,
        notes=_hashes(detections_report),
    )


def compare(
    offered: Sequence[Mapping[str, Any]],
    drawn: Sequence[Mapping[str, Any]],
    size: Array,
    settings: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """What became of each proposal of a frame, and what was added.

    offered, drawn : rows with class and box in shares of the image. size : (4,) its width, height, twice, px.
    A label goes with the free proposal of its class that it overlaps most, from ``moved_iou`` on. It is
    ``accepted`` where no edge lies farther than ``same_px``, which is what label tools round away.
    """
    a, b = _edges(offered) * size, _edges(drawn) * size
    same_class = np.array([[p["class"] == q["class"] for q in drawn] for p in offered], dtype=bool)
    iou = np.where(same_class.reshape(len(a), len(b)), overlaps(a, b), 0.0)
    lines, partner = [], {}
    for _ in range(min(iou.shape)):
        row, column = divmod(int(iou.argmax()), iou.shape[1])
        if iou[row, column] < settings["moved_iou"]:
            break
        partner[row] = (column, float(iou[row, column]))
        iou[row], iou[:, column] = -1.0, -1.0
    for number, proposal in enumerate(offered):
        line = {"class": proposal["class"], "proposal": number, "confidence": proposal["confidence"]}
        if number in partner:
            drawn_as, overlap = partner[number]
            moved = float(np.abs(a[number] - b[drawn_as]).max())
            outcome = ACCEPTED if moved <= settings["same_px"] else MOVED
            lines.append(line | {"outcome": outcome, "label": drawn_as, "iou": overlap, "moved_px": moved})
        else:
            lines.append(line | {"outcome": DELETED, "label": None, "iou": None, "moved_px": None})
    taken = {label for label, _ in partner.values()}
    nothing = {"proposal": None, "confidence": None, "iou": None, "moved_px": None}
    lines += [
        {"outcome": ADDED, "class": label["class"], "label": number, **nothing}
        for number, label in enumerate(drawn)
        if number not in taken
    ]
    return lines


def _edges(rows: Sequence[Mapping[str, Any]]) -> Array:
    centre = np.array([(row["x_center"], row["y_center"]) for row in rows]).reshape(-1, 2)
    half = np.array([(row["width"], row["height"]) for row in rows]).reshape(-1, 2) / 2
    return np.concatenate([centre - half, centre + half], axis=1)


def _by_frame(rows: Any) -> dict[int, list[dict[str, Any]]]:
    ordered = sorted(rows, key=lambda row: row["frame"])
    return {frame: list(group) for frame, group in groupby(ordered, key=lambda row: row["frame"])}


def _share(name: str, part: int, whole: int, what: str) -> Figure:
    return Figure(name, 100 * part / whole if whole else None, "%", f"Share of {what}.")


def _hashes(report: Path) -> list[str]:
    inputs = read_json(report, "report")["inputs"]
    return [f"{name} {inputs[name]}" for name in ("model", "sample")]
