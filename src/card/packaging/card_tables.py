"""Figures and tables of the dataset card, from the release's own tables and the reports of its stages."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from card.packaging.reader import SPLITS

Row = Mapping[str, Any]
MODES = {
    "group": "Frames that were taken near each other are kept in one split; where a stratum (topography and "
    "place) would have too few groups, drives are cut into blocks with gaps between them. ",
    "frame": "Every sampled frame was assigned by itself, so neighbours are in different splits. ",
}
TOPOGRAPHIES = ("positive", "negative", "off_road", "none", "unknown")


def counts(release: Row, sequences: Sequence[Row]) -> str:
    """Sequences, places, hours, kilometres, frames, files and bytes in one line."""
    seconds = sum(row["t_end_ns"] - row["t_start_ns"] for row in sequences) / 1e9
    metres = sum(row["distance_m"] or 0 for row in sequences)
    towns = len({row["place"] for row in sequences})
    frames = sum(release["frames"].values())
    return (
        f"{len(sequences)} sequences from {towns} places, {seconds / 3600:.3g} h, {metres / 1000:.3g} km, "
        f"{frames} frames, {release['files']} files, {release['bytes'] / 1e9:.3g} GB."
    )


def split_figures(report: Mapping[str, Any] | None) -> str:
    """What the splits are worth, as far as it is known."""
    if report is None:
        return "How near test frames are to training frames was not measured."
    mode = report["settings"]["mode"]
    value = {figure["name"]: figure["value"] for figure in report["figures"]}
    counts = report["counts"]
    unknown = (
        f" {counts['test_unknown']} test frames have training frames of their place without a common map."
    )
    tested = sum(counts[f"test_{state}"] for state in ("measured", "apart", "unknown"))
    if not tested:
        return f"{MODES[mode]}There are no test frames here."
    near = (
        f"95 % of the test frames lie {value['leak_m_p5']:.0f} m or more from the nearest training frame."
        if value["leak_m_p5"] is not None
        else "No training frame is known to be near a test frame."
    )
    balance = (
        f" Shares of the strata are off their targets by {value['stratum_deviation']:.3f} on average."
        if value["stratum_deviation"] is not None
        else ""
    )
    return MODES[mode] + near + (unknown if counts["test_unknown"] else "") + balance


def sequence_table(sequences: Sequence[Row]) -> str:
    """One line a sequence."""
    head = (
        "sequence",
        "place",
        "road type",
        "frames",
        "reviewed",
        "positive",
        "negative",
        "seconds",
        "metres",
    )
    return table(head, [_sequence_cells(row) for row in sequences])


def _sequence_cells(row: Row) -> tuple[Any, ...]:
    seconds = (row["t_end_ns"] - row["t_start_ns"]) / 1e9
    metres = "-" if row["distance_m"] is None else f"{row['distance_m']:.0f}"
    return (
        row["sequence"],
        row["place"],
        row["road_type"],
        row["frames"],
        row["reviewed_frames"],
        row["boxes_positive"],
        row["boxes_negative"],
        f"{seconds:.1f}",
        metres,
    )


def known_issues(
    release: Row,
    sequences: Sequence[Row],
    frames: Sequence[Row],
    reviews: Mapping[str, Row],
    retracted: int,
) -> str:
    """What a user has to know: overrides, labels or ground truth that nobody saw, incomplete ground truth."""
    lines = [
        f"- `{item['sequence']}`: {item['stage']} failed its gate `{item['figure']}`; released because "
        f"{item['reason']} (signed by {item['signed_by']})."
        for item in release["overrides"]
    ]
    for row in sequences:
        if left := row["frames"] - row["reviewed_frames"]:
            lines.append(
                f"- `{row['sequence']}`: labels of {left} of {row['frames']} frames are not reviewed."
            )
    lines += ground_truth_reviews(frames, reviews)
    flags = Counter(
        (row["sequence"], row["gt_flag"]) for row in frames if row["gt_flag"] not in (None, "complete")
    )
    lines += [
        f"- `{sequence}`: ground truth of {count} frames is flagged `{flag}`."
        for (sequence, flag), count in sorted(flags.items())
    ]
    if retracted:
        lines.append(f"- {retracted} files were retracted: `metadata/retractions.parquet`, `TAKEDOWN.md`.")
    return "\n".join(lines) or "None known."


def ground_truth_reviews(frames: Sequence[Row], reviews: Mapping[str, Row]) -> list[str]:
    """A line for each sequence whose ground truth is not signed off, or was accepted with a note."""
    lines = []
    for name in sorted({row["sequence"] for row in frames if row["gt_flag"] is not None}):
        review = reviews.get(name)
        if review is None:
            lines.append(f"- `{name}`: nobody has signed off the ground truth after looking at it.")
        elif review["note"] != "-":
            signed = f"{review['reviewer']} on {review['date']}"
            lines.append(f"- `{name}`: ground truth accepted by {signed}: {review['note']}.")
    return lines


def distribution(frames: Sequence[Row]) -> str:
    """Frames of each topography in each split, whose place is known."""
    found = Counter(((row["stratum"] or "unknown/").partition("/")[0], row["split"]) for row in frames)
    rows = [
        (name, *(found[name, split] for split in SPLITS), sum(found[name, split] for split in SPLITS))
        for name in TOPOGRAPHIES
    ]
    boxes = []
    for kind in ("positive", "negative"):
        inside = Counter[str]()
        for row in frames:
            inside[row["split"]] += row[f"boxes_{kind}"]
        boxes.append((f"boxes {kind}", *(inside[split] for split in SPLITS), inside.total()))
    return table(("topography", *SPLITS, "all"), rows + boxes)


def places(sequences: Sequence[Row]) -> str:
    """Frames, time and way of each place."""
    rows: dict[str, list[Row]] = {}
    for row in sequences:
        rows.setdefault(row["place"], []).append(row)
    return table(
        ("place", "country", "sequences", "frames", "minutes", "km"),
        [
            (
                place,
                found[0]["country"],
                len(found),
                sum(row["frames"] for row in found),
                f"{sum(row['t_end_ns'] - row['t_start_ns'] for row in found) / 60e9:.1f}",
                f"{sum(row['distance_m'] or 0 for row in found) / 1000:.2f}",
            )
            for place, found in sorted(rows.items())
        ],
    )


def quality_figures(documents: Iterable[Row]) -> str:
    """Every gated figure: its limit, and the worst and median sequence."""
    found: dict[tuple[Any, ...], list[float | None]] = {}
    for document in documents:
        for stage, stated in document["stages"].items():
            for gate in stated["gates"]:
                key = (stage, gate["figure"], gate["unit"], gate["better"], gate["threshold"])
                found.setdefault(key, []).append(gate["value"])
    rows = []
    for (stage, figure, unit, better, threshold), values in sorted(found.items()):
        known = sorted((value for value in values if value is not None), reverse=better == "lower")
        worst, middle = (f"{known[0]:.3g}", f"{known[len(known) // 2]:.3g}") if known else ("-", "-")
        side = "at least" if better == "higher" else "at most"
        rows.append(
            (stage, f"`{figure}`", unit, f"{side} {threshold:g}", middle, worst, len(values) - len(known))
        )
    return (
        table(("stage", "figure", "unit", "limit", "median", "worst", "unknown"), rows)
        if rows
        else "No gates."
    )


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
