"""The report beside every artifact: settings, inputs, counts, figures and gates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from card.artifacts.documents import write_json
from card.artifacts.hashing import sha256_file
from card.errors import CardError

# Libraries whose version can change an artifact's bytes.
LIBRARIES = (
    "numpy",
    "scipy",
    "open3d",
    "opencv-python-headless",
    "laspy",
    "lazrs",
    "pyarrow",
    "small-gicp",
    "gtsam",
    "numba",
    "jpeglib",
    "onnxruntime",
    "pycocotools",
)


@dataclass(frozen=True)
class Figure:
    """One quality figure; ``value`` is None where it could not be determined."""

    name: str
    value: float | None
    unit: str
    description: str


def write_report(
    path: Path,
    *,
    stage: str,
    settings: Mapping[str, Any],
    inputs: Mapping[str, Path],
    counts: Mapping[str, int],
    figures: Sequence[Figure] = (),
    gates: Sequence[Mapping[str, Any]] = (),
    overrides: Sequence[Mapping[str, str]] = (),
    sequence: str | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Write ``<artifact>.report.json``.

    Parameters
    ----------
    inputs : name to the file whose hash is recorded.
    gates : ``{figure, unit, better, threshold}`` each; a figure that is missing fails its gate.
    overrides : ``{figure, signed_by, reason}`` each; a failed gate named here is ``overridden``.

    Raises
    ------
    CardError
        For a gate in another unit than its figure, which would compare what cannot be compared.
    """
    units = {figure.name: figure.unit for figure in figures}
    for gate in gates:
        if units.get(gate["figure"], gate["unit"]) != gate["unit"]:
            raise CardError(
                f"gate on {gate['figure']} has another unit than the figure",
                where=f"stage {stage}",
                found=gate["unit"],
                wanted=units[gate["figure"]],
            )
    values = {figure.name: figure.value for figure in figures}
    document = {
        "schema": "report",
        "stage": stage,
        "sequence": sequence,
        "settings": settings,
        "inputs": {name: sha256_file(file) for name, file in sorted(inputs.items())},
        "counts": counts,
        "figures": [asdict(figure) | {"value": _finite(figure.value)} for figure in figures],
        "gates": [_verdict(gate, _finite(values.get(gate["figure"])), overrides) for gate in gates],
        "notes": list(notes),
        "versions": {name: _version(name) for name in LIBRARIES},
    }
    write_json(path, document, "report")


def _verdict(
    gate: Mapping[str, Any], value: float | None, overrides: Sequence[Mapping[str, str]]
) -> dict[str, Any]:
    if value is None:
        passed = False
    elif gate["better"] == "higher":
        passed = value >= gate["threshold"]
    else:
        passed = value <= gate["threshold"]
    result: dict[str, Any] = {name: gate[name] for name in ("figure", "unit", "better", "threshold")}
    result |= {"value": value, "verdict": "pass" if passed else "fail"}
    for override in overrides:
        if not passed and override["figure"] == gate["figure"]:
            result |= {
                "verdict": "overridden",
                "signed_by": override["signed_by"],
                "reason": override["reason"],
            }
    return result


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def _version(name: str) -> str | None:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return None
