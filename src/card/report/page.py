"""Stage `report`: one page about a release that people want to read."""

from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from card.artifacts import atomic_folder, progress, read_json
from card.report.gates import badge, notes_list, quality_table, verdicts
from card.report.numbers import NONE, distance, duration, number
from card.report.sequence import Drawn, draw_sequence
from card.report.totals import Tree, license_table, read_tree, tiles

TEMPLATE = Path(__file__).with_name("page.html")
# The package's quality document holds the stages it stands on; these report later.
CHAIN = (
    "import_bag",
    "ingest",
    "calibration",
    "odometry",
    "pose_graph",
    "poses",
    "ground_truth",
    "wheels",
    "privacy",
    "annotations",
)
LATER_STAGES = {
    "irregularities": "irregularities.report.json",
    "splits": "splits.report.json",
    "packaging": "package.report.json",
}


@dataclass(frozen=True)
class Chapter:
    """One sequence: its row of the sheet, the reports of its stages, its row of the release, its figures."""

    row: Mapping[str, Any]
    stages: Mapping[str, Mapping[str, Any]]
    released: Mapping[str, Any]
    figures: Sequence[Drawn]

    @property
    def id(self) -> str:
        """Id of the sequence."""
        return str(self.row["id"])


def page(
    *, results: Path, sequences: Sequence[Mapping[str, Any]], release: Sequence[Path], out: Path
) -> None:
    """Write ``out/index.html``, which holds its figures and asks no host, and the figures as PNG beside it.

    Parameters
    ----------
    results : folder with the artifacts of each sequence.
    sequences : rows of the sequence sheet. release : the release trees that hold them.
    out : folder of the page; replaced as a whole.
    """
    trees = [read_tree(tree) for tree in release]
    released = {row["sequence"]: row for tree in trees for row in tree.sequences}
    with atomic_folder(out) as folder:
        chapters = [
            _chapter(results / row["id"], row, released[row["id"]], folder / "figures")
            for row in progress(sequences, "report")
        ]
        (folder / "index.html").write_text(_html(chapters, trees), encoding="utf-8")


def _chapter(folder: Path, row: Mapping[str, Any], released: Mapping[str, Any], figures: Path) -> Chapter:
    stated = read_json(folder / "package" / "sidecars" / "quality.json", "quality")["stages"]
    known = [stage for stage in CHAIN if stage in stated]
    stages = {stage: stated[stage] for stage in [*known, *sorted(set(stated) - set(known))]}
    for stage, name in LATER_STAGES.items():
        if (folder / name).is_file():
            stages[stage] = read_json(folder / name, "report")
    return Chapter(row, stages, released, draw_sequence(folder, stages, figures))


def _html(chapters: Sequence[Chapter], trees: Sequence[Tree]) -> str:
    total = sum((verdicts(chapter.stages) for chapter in chapters), Counter())
    gates = ", ".join(f"{total[name]} {name}" for name in ("pass", "fail", "overridden") if total[name])
    names = " and ".join(f"{tree.document['repository']} {tree.document['version']}" for tree in trees)
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        title="Release report",
        lead=f"{escape(names)}. Gates: {gates or 'none set'}.",
        tiles=tiles(trees),
        licenses=license_table(trees),
        contents=_contents(chapters),
        sections="\n".join(map(_section, chapters)),
    )


def _contents(chapters: Sequence[Chapter]) -> str:
    lines = []
    for chapter in chapters:
        row, released = chapter.row, chapter.released
        lines.append(
            f'<tr><td><a href="#{chapter.id}">{chapter.id}</a></td><td>{escape(row["place"])}</td>'
            f"<td>{escape(row['country'])}</td><td>{escape(row['road_type'])}</td>"
            f"<td>{row['role'].replace('_', '-')}</td>"
            f'<td class="n">{number(released["frames"])}</td><td class="n">{_driven(released)}</td>'
            f"<td>{badge(verdicts(chapter.stages))}</td></tr>"
        )
    return (
        "<table><thead><tr><th>sequence</th><th>place</th><th>country</th><th>road</th><th>role</th>"
        '<th class="n">frames</th><th class="n">driven</th><th>gates</th></tr></thead><tbody>'
        + "".join(lines)
        + "</tbody></table>"
    )


def _section(chapter: Chapter) -> str:
    row, released = chapter.row, chapter.released
    seconds = (released["t_end_ns"] - released["t_start_ns"]) / 1e9
    facts = [
        f"{row['place']}, {row['country']}",
        row["road_type"] + (", off-road" if released["off_road"] else ""),
        f"session {row['session']}" if row["session"] else "no session",
        f"{number(released['frames'])} frames, {number(released['reviewed_frames'])} reviewed",
        f"{released['boxes_positive']} positive and {released['boxes_negative']} negative boxes",
        duration(seconds)
        if released["distance_m"] is None
        else f"{_driven(released)} in {duration(seconds)}",
        released["spdx"],
        released["modalities"].replace(",", ", ").replace("_", " "),
    ]
    return "\n".join(
        [
            f'<h2 id="{chapter.id}">{chapter.id}</h2>',
            f'<p class="facts">{"".join(f"<span>{escape(fact)}</span>" for fact in facts)}</p>',
            *map(_figure, chapter.figures),
            quality_table(chapter.stages),
            notes_list(chapter.stages),
        ]
    )


def _figure(drawn: Drawn) -> str:
    data = b64encode(drawn.path.read_bytes()).decode()
    caption = escape(drawn.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _driven(released: Mapping[str, Any]) -> str:
    return NONE if released["distance_m"] is None else distance(released["distance_m"])
