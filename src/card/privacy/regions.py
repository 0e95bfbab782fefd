"""Fill regions of anonymized images that somebody asked to have removed."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

from card.artifacts import atomic_folder, inventory, read_table, write_report, write_table
from card.errors import CardError
from card.privacy.detection import Detection
from card.privacy.redaction import redact


def fill_regions(
    *,
    anonymized: Path,
    frames: Path,
    takedowns: Sequence[Mapping[str, Any]],
    out: Path,
    report: Path,
) -> None:
    """Write `out`: copies of just those images that have a region to fill, with the table `images` of them.

    Parameters
    ----------
    anonymized : folder of the privacy stage. frames : table `frames` of the sequence.
    takedowns : entries with `frames` [first, last] and `region` {camera, x_min, y_min, x_max, y_max}, or
        null for one that is about whole frames. The maxima are excluded; the fill covers whole MCUs.

    CardError for a region outside the image.
    """
    boxes: dict[tuple[str, int], list[Detection]] = {}
    for row in read_table(frames, "frames").to_pylist():
        for entry in takedowns:
            region = entry["region"]
            if region is None or not entry["frames"][0] <= row["frame"] <= entry["frames"][1]:
                continue
            t_ns = row["t_ns" if region["camera"] == "camera_left" else "right_t_ns"]
            if t_ns is not None:
                # Of a box to fill only its edges count.
                box = Detection(
                    kind="face",
                    x_min=region["x_min"] - 0.5,
                    y_min=region["y_min"] - 0.5,
                    x_max=region["x_max"] - 0.5,
                    y_max=region["y_max"] - 0.5,
                    score=1.0,
                    source="takedown",
                    model_sha256="",
                )
                boxes.setdefault((region["camera"], t_ns), []).append(box)
    images = {
        (row["camera"], row["t_ns"]): row
        for row in read_table(anonymized / "images.parquet", "images").to_pylist()
    }
    rows = []
    with atomic_folder(out) as folder:
        for key, found in sorted(boxes.items()):
            image = images.get(key)
            if image is None:
                raise CardError(
                    "no anonymized image to fill", where=anonymized, found=f"{key[0]} at {key[1]} ns"
                )
            for box in found:
                if box.x_max > image["width"] or box.y_max > image["height"]:
                    raise CardError(
                        "region outside the image",
                        where=f"{key[0]} at {key[1]} ns",
                        found=f"{box.x_max + 0.5:g}, {box.y_max + 0.5:g}",
                        wanted=f"at most {image['width']}, {image['height']}",
                    )
            source = anonymized / image["file"]
            filled = redact(source.read_bytes(), found, dilation_px=0, where=source)
            target = folder / image["file"]
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(filled.content)
            rows.append(
                image
                | {
                    "redactions": image["redactions"] + len(found),
                    "redacted_pixels": filled.pixels,
                    "sha256": sha256(filled.content).hexdigest(),
                    "source_sha256": image["sha256"],
                }
            )
        columns = {name: [row[name] for row in rows] for name in next(iter(images.values()), {})}
        write_table(folder / "images.parquet", columns, "images")
        write_table(folder / "inventory.parquet", inventory(folder), "inventory")
    write_report(
        report,
        stage="regions",
        sequence=out.parent.name,
        settings={"takedowns": list(takedowns)},
        inputs={"anonymized": anonymized / "inventory.parquet", "frames": frames},
        counts={"images": len(rows), "regions": sum(map(len, boxes.values()))},
    )
