"""The folder of a method's trajectories: ``<sequence>.txt`` in TUM's form."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.errors import CardError
from card.geometry import transform

Array = NDArray[np.float64]

#: A stamp this near to a frame's is the frame's: the form has seconds, not nanoseconds.
STAMP_TOLERANCE_NS = 1_000_000


def find_trajectories(folder: Path, sequences: Iterable[str]) -> None:
    """CardError unless the folder holds one trajectory for each sequence and nothing else."""
    if not folder.is_dir():
        raise CardError("no folder of predictions", where=folder)
    there = {path.name for path in folder.iterdir()}
    wanted = {f"{name}.txt" for name in sequences}
    for names, what in (
        (wanted - there, "prediction is missing"),
        (there - wanted, "not a prediction of this split"),
    ):
        if names:
            raise CardError(what, where=folder / min(names), wanted="<sequence>.txt of the split's sequences")


def read_trajectory(path: Path, times: Sequence[int]) -> tuple[NDArray[np.int64], Array]:
    """Which of the frames at ``times`` (N,) ns have a pose, and these poses (K, 4, 4)."""
    poses: dict[int, Array] = {}
    stamps = np.array(times, dtype=np.int64)
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        where = f"{path}:{number}"
        try:
            t, *values = map(float, line.split())
            # A float of seconds since 1970 resolves 0.2 microseconds.
            t_ns = round(t * 1e9)
            x, y, z, qx, qy, qz, qw = values
        except ValueError as error:
            raise CardError("not a line of a TUM trajectory", where=where, found=error) from error
        norm = float(np.linalg.norm([qx, qy, qz, qw]))
        if not np.isfinite([x, y, z]).all() or not abs(norm - 1) < 1e-2:
            raise CardError("no pose", where=where, found=f"quaternion of length {norm:g}", wanted="1")
        frame = int(np.argmin(np.abs(stamps - t_ns)))
        strange = abs(stamps[frame] - t_ns) > STAMP_TOLERANCE_NS
        if strange or frame in poses:
            what = "pose of no frame" if strange else "frame given twice"
            raise CardError(
                what, where=where, found=f"t {t:.6f} s", wanted="t_ns of a frame of the sequence, in s"
            )
        poses[frame] = transform([x, y, z], np.array([qw, qx, qy, qz]) / norm)
    if len(poses) < 2:
        raise CardError(
            "trajectory is too short", where=path, found=f"{len(poses)} poses", wanted="2 or more"
        )
    used = sorted(poses)
    return np.array(used, dtype=np.int64), np.array([poses[frame] for frame in used])
