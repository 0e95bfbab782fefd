"""The scores of all frames, kept as columns: the Parquet tables of an evaluation and its summary rows."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from card.artifacts import write_table
from card.benchmark.averages import average
from card.benchmark.frame_scores import FrameScores
from card.benchmark.pixel_metrics import SUMS, metrics_of

REGIONS = ("full", "boxes")
#: What each table is keyed by, apart from what all share.
KEYS: dict[str, tuple[str, ...]] = {"frames": ("scale",), "boxes": ("box", "class", "distance_m"),
                                    "distances": ("from_m", "to_m")}  # fmt: skip
SHARED = ("sequence", "frame", "place", "light", "scaling", "input_pixels")


class Results:
    """Rows of the three tables, added frame by frame."""

    def __init__(self, scalings: Sequence[str], settings: Mapping[str, Any]) -> None:
        self.scalings = scalings
        self.settings = settings
        edges = [settings["min_depth_m"], *settings["distance_edges_m"], settings["max_depth_m"]]
        self.ranges = list(pairwise(edges))
        self._rows: dict[str, list[dict[str, Any]]] = {name: [] for name in KEYS}
        self._sums: dict[str, list[Any]] = {name: [] for name in KEYS}

    def add(
        self, frame: Mapping[str, Any], classes: Sequence[str], scores: FrameScores, input_pixels: str
    ) -> None:
        """Scores of a frame, a row of the release's frame table; classes : of its boxes."""
        for s, scaling in enumerate(self.scalings):
            shared = {name: frame[name] for name in SHARED[:4]}
            shared |= {"scaling": scaling, "input_pixels": input_pixels}
            self._add("frames", shared | {"scale": float(scores.scales[s])}, scores.full[s])
            for index, name in enumerate(classes):
                depth = None if np.isnan(scores.box_depth[index]) else float(scores.box_depth[index])
                box = {"box": index, "class": name, "distance_m": depth}
                self._add("boxes", shared | box, scores.boxes[s, index])
            for index, (start, stop) in enumerate(self.ranges):
                self._add("distances", shared | {"from_m": start, "to_m": stop}, scores.distances[s, index])

    def _add(self, table: str, row: dict[str, Any], sums: Any) -> None:
        self._rows[table].append(row)
        self._sums[table].append(sums)

    def write(self, folder: Path) -> None:
        """Write ``frames.parquet``, ``boxes.parquet`` and ``distances.parquet``."""
        for name, rows in self._rows.items():
            sums = np.array(self._sums[name]).reshape(-1, len(SUMS))
            columns: dict[str, Any] = {key: [row[key] for row in rows] for key in (*SHARED, *KEYS[name])}
            columns["truth_pixels"] = sums[:, SUMS.index("truth")].astype(np.int64)
            columns["pixels"] = sums[:, SUMS.index("pixels")].astype(np.int64)
            columns["valid_pixels"] = sums[:, SUMS.index("valid")].astype(np.int64)
            for metric, values in metrics_of(sums).items():
                columns[metric] = [None if np.isnan(value) else float(value) for value in values]
            write_table(folder / f"{name}.parquet", columns, f"evaluation_{name}")

    def summary(self) -> list[dict[str, Any]]:
        """Rows of document `evaluation`: the whole, then the breakdowns that each region has."""
        found = []
        for input_pixels in dict.fromkeys(row["input_pixels"] for row in self._rows["frames"]) or ("all",):
            for scaling in self.scalings:
                case = {"scaling": scaling, "input_pixels": input_pixels}
                for region, table in zip(REGIONS, ("frames", "boxes"), strict=True):
                    found += self._groups(region, table, case, [("all", _nothing)])
                found += self._groups(
                    "full", "frames", case, [("place", _key("place")), ("light", _key("light"))]
                )
                found += self._groups("full", "distances", case, [("distance", self._range)])
                by = [("class", _key("class")), ("distance", self._box_range)]
                by += [("place", _key("place")), ("light", _key("light"))]
                found += self._groups("boxes", "boxes", case, by)
        return found

    def _groups(
        self, region: str, table: str, case: Mapping[str, str], groupings: Iterable[Any]
    ) -> list[dict[str, Any]]:
        rows = self._rows[table]
        chosen = [i for i, row in enumerate(rows) if all(row[name] == value for name, value in case.items())]
        summaries = []
        for name, value_of in groupings:
            members: dict[str, list[int]] = {"": []} if name == "all" else {}
            for i in chosen:
                if (value := value_of(rows[i])) is not None:
                    members.setdefault(value, []).append(i)
            for value in sorted(members, key=_natural):
                sums = np.array([self._sums[table][i] for i in members[value]]).reshape(-1, len(SUMS))
                if name != "all" and not sums[:, SUMS.index("truth")].any():
                    continue
                sequences = [rows[i]["sequence"] for i in members[value]]
                head = {"region": region, **case, "by": name, "group": value}
                summaries.append(head | average(sums, sequences, self.settings))
        return summaries

    def _range(self, row: Mapping[str, Any]) -> str:
        return f"{row['from_m']:g}-{row['to_m']:g} m"

    def _box_range(self, row: Mapping[str, Any]) -> str | None:
        """The range that the middle of a box lies in."""
        if row["distance_m"] is None:
            return None
        for start, stop in self.ranges:
            if row["distance_m"] < stop:
                return f"{start:g}-{stop:g} m"
        return f"{self.ranges[-1][0]:g}-{self.ranges[-1][1]:g} m"


def _nothing(row: Mapping[str, Any]) -> str:
    return ""


def _key(name: str) -> Any:
    return lambda row: row[name]


def _natural(value: str) -> tuple[float, str]:
    """Ranges by where they begin, names by their letters."""
    head = value.split("-")[0]
    return (float(head), "") if head.replace(".", "").isdigit() and value.endswith(" m") else (0.0, value)
