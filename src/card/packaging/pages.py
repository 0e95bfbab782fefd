"""The pages of a release tree, filled from the templates in `release/`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

import yaml

from card.artifacts import load_schema
from card.errors import CardError
from card.packaging.reader import SPLITS

COPIED = ("CONVENTIONS.md", "CHANGELOG.md")
FILLED = ("README.md", "NOTICE", "CITATION.cff", "TAKEDOWN.md")
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))


def write_pages(
    tree: Path,
    *,
    templates: Path,
    release: Mapping[str, Any],
    sequences: Sequence[Mapping[str, Any]],
    terms: Mapping[str, Any],
    about: Mapping[str, Any],
    gate: str | None,
    splits: Mapping[str, Any] | None,
    has_mini: bool,
) -> None:
    """Write all pages into `tree`.

    Parameters
    ----------
    templates : folder `release/`.
    release : document `release`; sequences : rows of the sequence table.
    terms : the licence's entry of `config/licenses.yaml`.
    about : title, creator, authors, contact and url from the settings.
    gate : what readers of a gated repository agree to, None for an open one.
    splits : report of the stage `split_report`, None without frames.
    has_mini : whether `mini.parquet` has rows.
    """
    values = {
        **about,
        "repository": release["repository"],
        "version": release["version"],
        "date": release["date"],
        "year": release["date"][:4],
        "spdx": release["spdx"],
        "license_name": terms["name"],
        "license_url": terms["url"],
        "attribution": terms["attribution"],
        "commercial": "Commercial use is permitted."
        if terms["commercial"]
        else "Commercial use is not permitted.",
        "front_matter": yaml.safe_dump(
            front_matter(release, about["title"], has_mini) | ({"extra_gated_prompt": gate} if gate else {}),
            sort_keys=False,
            allow_unicode=True,
        ),
        "authors": yaml.safe_dump([{"name": name} for name in about["authors"]], allow_unicode=True),
        "example_split": next((split for split in SPLITS if release["frames"][split]), SPLITS[0]),
        "counts": _counts(release, sequences),
        "split_table": _table(("split", "frames"), [(split, release["frames"][split]) for split in SPLITS]),
        "split_figures": _split_figures(splits),
        "sequence_table": _table(
            (
                "sequence",
                "place",
                "road type",
                "frames",
                "reviewed",
                "positive",
                "negative",
                "seconds",
                "metres",
            ),
            [_sequence_cells(row) for row in sequences],
        ),
        "known_issues": _known_issues(release, sequences),
    }
    for name in FILLED:
        template = templates / f"{name}.tmpl"
        try:
            text = Template(template.read_text(encoding="utf-8")).substitute(values)
        except (KeyError, ValueError) as error:
            raise CardError("template asks for an unknown value", where=template, found=error) from error
        (tree / name).write_text(text, encoding="utf-8")
    for name in COPIED:
        (tree / name).write_bytes((templates / name).read_bytes())
    (tree / "LICENSE").write_bytes((templates / "licenses" / terms["text"]).read_bytes())


def front_matter_of(page: Path) -> dict[str, Any]:
    """YAML that a dataset card opens with."""
    found: dict[str, Any] = yaml.safe_load(page.read_text(encoding="utf-8").split("---\n", 2)[1])
    return found


def front_matter(release: Mapping[str, Any], title: str, has_mini: bool) -> dict[str, Any]:
    """YAML of the dataset card: Parquet configs only, each with its files by name.

    A table without rows is left out, because `datasets` refuses to load a whole config for one empty
    split; its file is in the tree all the same.
    """
    frames = sum(release["frames"].values())
    files = {
        "frames": {s: f"metadata/frames-{s}.parquet" for s in SPLITS if release["frames"][s]},
        "sequences": {"full": "metadata/sequences.parquet"} if release["sequences"] else {},
        "members": {"full": "metadata/members.parquet"} if release["files"] else {},
        "mini": {"full": "mini/mini.parquet"} if has_mini else {},
    }
    configs: list[dict[str, Any]] = [
        {"config_name": name, "data_files": [{"split": s, "path": path} for s, path in listed.items()]}
        for name, listed in files.items()
        if listed
    ]
    if configs:
        configs[0]["default"] = True
    return {
        "pretty_name": title,
        "license": release["spdx"].lower(),
        "task_categories": ["depth-estimation", "object-detection"],
        "tags": ["autonomous-driving", "road-topography", "lidar", "stereo"],
        "size_categories": [next((name for limit, name in SIZES if frames < limit), "n>1M")],
        "dataset_info": [{"config_name": "mini", "features": _features("release_mini")}] if has_mini else [],
        "configs": configs,
    }


def _features(schema: str) -> list[dict[str, str]]:
    """Features of a table for `datasets`, which shows what is binary here as pictures."""
    return [
        {"name": name, "dtype": "image" if field["type"] == "binary" else field["type"]}
        for name, field in load_schema(schema)["columns"].items()
    ]


def _counts(release: Mapping[str, Any], sequences: Sequence[Mapping[str, Any]]) -> str:
    seconds = sum(row["t_end_ns"] - row["t_start_ns"] for row in sequences) / 1e9
    metres = sum(row["distance_m"] or 0 for row in sequences)
    places = len({row["place"] for row in sequences})
    frames = sum(release["frames"].values())
    return (
        f"{len(sequences)} sequences from {places} places, {seconds / 3600:.3g} h, {metres / 1000:.3g} km, "
        f"{frames} frames, {release['files']} files, {release['bytes'] / 1e9:.3g} GB."
    )


def _split_figures(report: Mapping[str, Any] | None) -> str:
    """What the splits are worth, as far as it is known."""
    if report is None:
        return "There are no frames to split."
    value = {figure["name"]: figure["value"] for figure in report["figures"]}
    counts = report["counts"]
    unknown = (
        f" {counts['test_unknown']} test frames have training frames of their place without a common map."
    )
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
    return near + (unknown if counts["test_unknown"] else "") + balance


def _sequence_cells(row: Mapping[str, Any]) -> tuple[Any, ...]:
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


def _known_issues(release: Mapping[str, Any], sequences: Sequence[Mapping[str, Any]]) -> str:
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
    return "\n".join(lines) or "None known."


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
