"""A page that shows what was redacted, and the list of redactions that touch a labelled irregularity."""

from base64 import b64encode
from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from card.artifacts import atomic_folder, read_json, read_table, write_table
from card.privacy.tables import Image

_COLOURS = {"face": (60, 60, 230), "plate": (230, 140, 40)}  # BGR
_SAMPLE_PX = 420
_STYLE = (
    "body{font:15px system-ui;max-width:1200px;margin:2em auto;padding:0 1em;color:#1d232b}"
    "table{border-collapse:collapse}td,th{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:left}"
    "td.n{text-align:right;font-variant-numeric:tabular-nums}img{margin:4px;border-radius:4px}"
)


def audit(
    *, anonymized: Path, labels: Path, privacy_report: Path, out: Path, settings: Mapping[str, Any]
) -> None:
    """Write ``out/index.html`` and ``out/redacted_irregularities.parquet``.

    Parameters
    ----------
    anonymized : folder with the redacted images and tables ``images`` and ``redactions``.
    labels : table ``labels``; a box that a redaction touches is listed for review and stays what it is.
    privacy_report : report of the stage, for its figures.
    settings : ``samples``, images a camera on the page.
    """
    images = read_table(anonymized / "images.parquet", "images").to_pylist()
    redactions: dict[Image, list[dict[str, Any]]] = {}
    for row in read_table(anonymized / "redactions.parquet", "redactions").to_pylist():
        redactions.setdefault((row["camera"], row["t_ns"]), []).append(row)
    sizes = {(row["camera"], row["t_ns"]): (row["width"], row["height"]) for row in images}
    touched = _touched(read_table(labels, "labels").to_pylist(), redactions, sizes)
    report = read_json(privacy_report, "report")
    with atomic_folder(out) as folder:
        names = [
            *("frame", "t_ns", "class", "x_min", "y_min", "x_max", "y_max"),
            *("redacted_share", "sources"),
        ]
        columns = {name: [row[name] for row in touched] for name in names}
        write_table(folder / "redacted_irregularities.parquet", columns, "redacted_irregularities")
        page = _page(
            out.parent.name, report, redactions, touched, _samples(images, anonymized, redactions, settings)
        )
        (folder / "index.html").write_text(page, encoding="utf-8")


def _touched(
    labels: Sequence[Mapping[str, Any]],
    redactions: Mapping[Image, Sequence[Mapping[str, Any]]],
    sizes: Mapping[Image, tuple[int, int]],
) -> list[dict[str, Any]]:
    """Labelled boxes of which a redaction covers a pixel, with their edges in px and the share covered."""
    of_frame = {
        rows[0]["frame"]: (image, rows) for image, rows in redactions.items() if image[0] == "camera_left"
    }
    found = []
    for label in labels:
        if label["frame"] not in of_frame:
            continue
        image, rows = of_frame[label["frame"]]
        edges = _edges(label, sizes[image])
        left, top, right, bottom = (int(np.ceil(edge)) for edge in edges)
        mask = np.zeros((max(1, bottom - top), max(1, right - left)), dtype=bool)
        sources = set()
        for row in rows:
            part = mask[
                max(0, row["y_min"] - top) : max(0, row["y_max"] - top),
                max(0, row["x_min"] - left) : max(0, row["x_max"] - left),
            ]
            if part.size:
                part[:] = True
                sources.add(row["source"])
        if sources:
            share, named = float(mask.mean()), ", ".join(sorted(sources))
            box = dict(zip(("x_min", "y_min", "x_max", "y_max"), edges, strict=True))
            kept = {"frame": label["frame"], "t_ns": image[1], "class": label["class"]}
            found.append({**kept, **box, "redacted_share": share, "sources": named})
    return found


def _edges(label: Mapping[str, Any], size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Edges in px, pixel centres at integers, of a label in shares of the image."""
    width, height = size
    x, y = label["x_center"] * width - 0.5, label["y_center"] * height - 0.5
    dx, dy = label["width"] * width / 2, label["height"] * height / 2
    return x - dx, y - dy, x + dx, y + dy


def _samples(
    images: Sequence[Mapping[str, Any]],
    anonymized: Path,
    redactions: Mapping[Image, Sequence[Mapping[str, Any]]],
    settings: Mapping[str, Any],
) -> list[tuple[str, NDArray[np.uint8]]]:
    """Of each camera the images with most redacted pixels, small, with the boxes outlined."""
    samples = []
    for camera in ("camera_left", "camera_right"):
        mine = [row for row in images if row["camera"] == camera]
        mine.sort(key=lambda row: (-row["redacted_pixels"], row["t_ns"]))
        for row in mine[: settings["samples"]]:
            pixels: Any = cv2.imread(str(anonymized / row["file"]))
            scale = _SAMPLE_PX / max(pixels.shape[:2])
            small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            for box in redactions.get((camera, row["t_ns"]), ()):
                corners = [round(scale * box[name]) for name in ("x_min", "y_min", "x_max", "y_max")]
                cv2.rectangle(small, corners[:2], corners[2:], _COLOURS[box["kind"]], 1)
            samples.append(
                (f"{camera} {row['t_ns']}: {row['redactions']} boxes", np.asarray(small, dtype=np.uint8))
            )
    return samples


def _page(
    sequence: str,
    report: Mapping[str, Any],
    redactions: Mapping[Image, Sequence[Mapping[str, Any]]],
    touched: Sequence[Mapping[str, Any]],
    samples: Sequence[tuple[str, NDArray[np.uint8]]],
) -> str:
    counts = Counter((row["kind"], row["source"]) for rows in redactions.values() for row in rows)
    verdicts = {gate["figure"]: gate["verdict"] for gate in report["gates"]}
    figures = [
        (
            figure["name"],
            "-" if figure["value"] is None else f"{figure['value']:.2f} {figure['unit']}",
            verdicts.get(figure["name"], ""),
            figure["description"],
        )
        for figure in report["figures"]
    ]
    listed = [
        (row["frame"], row["class"], f"{100 * row['redacted_share']:.1f} %", row["sources"])
        for row in touched
    ]
    return "\n".join(
        [
            f"<!doctype html><html lang=en><meta charset=utf-8><title>Privacy audit of {sequence}</title>",
            f"<style>{_STYLE}</style><h1>Privacy audit of {escape(sequence)}</h1>",
            _table(("figure", "value", "gate", "what it is"), figures),
            "<h2>What found the boxes</h2>",
            _table(("kind", "source", "boxes"), [(*key, count) for key, count in sorted(counts.items())]),
            "<h2>Redactions on labelled irregularities</h2>",
            "<p>For review; nothing was dropped. Clear a wrong one in <code>privacy_review.csv</code>.</p>",
            _table(("frame", "label", "redacted", "found by"), listed),
            "<h2>Images with most redacted pixels</h2>",
            "<p>As released; faces outlined in red, plates in blue.</p>",
            *(_image(caption, pixels) for caption, pixels in samples),
        ]
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    cells = "".join(f"<tr>{''.join(f'<td>{escape(str(cell))}</td>' for cell in row)}</tr>" for row in rows)
    titles = "".join(f"<th>{name}</th>" for name in head)
    return f"<table><tr>{titles}</tr>{cells or '<tr><td>none</td></tr>'}</table>"


def _image(caption: str, pixels: NDArray[np.uint8]) -> str:
    _, png = cv2.imencode(".png", pixels)
    data = b64encode(png.tobytes()).decode()
    return f'<img alt="{escape(caption)}" title="{escape(caption)}" src="data:image/png;base64,{data}">'
