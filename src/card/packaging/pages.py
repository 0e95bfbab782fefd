"""The pages of a release tree, filled from the templates in `release/`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from string import Template
from typing import Any

import yaml

from card.artifacts import load_schema
from card.errors import CardError
from card.packaging import card_tables
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
    frames: Sequence[Mapping[str, Any]],
    quality: Sequence[Mapping[str, Any]],
    reviews: Mapping[str, Mapping[str, Any]],
    retracted: int,
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
    release : document `release`; sequences, frames : rows of these tables.
    quality : documents `quality` of the sequences. retracted : rows of the table of retractions.
    reviews : of the ground truth, by sequence.
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
        "counts": card_tables.counts(release, sequences),
        "split_table": card_tables.table(
            ("split", "frames"), [(split, release["frames"][split]) for split in SPLITS]
        ),
        "split_figures": card_tables.split_figures(splits),
        "distribution": card_tables.distribution(frames),
        "place_table": card_tables.places(sequences),
        "sequence_table": card_tables.sequence_table(sequences),
        "quality_table": card_tables.quality_figures(quality),
        "known_issues": card_tables.known_issues(release, sequences, frames, reviews, retracted),
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
