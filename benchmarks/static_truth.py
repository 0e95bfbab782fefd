"""The static voxel set of a simulated drive against what each of its points really met."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from card.artifacts import progress, read_arrays
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap
from card.ground_truth.voxels import find
from card.recording.laz import read_burst

#: DUFOMap's own defaults for 10 cm voxels: inflation of hits (m) and of the unknown (voxels).
DUFOMAP = {"resolution": 0.1, "d_s": 0.2, "d_p": 2}


def moving_points(drive: Drive, truth: Path, i: int) -> NDArray[np.bool_]:
    """(N,) whether each point of sweep `i` moves. truth : folder of the drive's truth."""
    file = truth / "bursts" / drive.sensor(i) / f"{drive.files[i].stem}.npz"
    dynamic = read_arrays(file, "truth_burst")["dynamic"]
    # Each point has a firing time of its own.
    return dynamic[np.isin(read_burst(drive.files[i]).time_ns, drive.sweep(i).time_ns)]


def moving_counts(drive: Drive, truth: Path, voxels: VoxelMap) -> NDArray[np.int64]:
    """(V,) points of each voxel that move."""
    counts = np.zeros(len(voxels.keys), dtype=np.int64)
    for i in progress(range(len(drive)), "truth"):
        moving = moving_points(drive, truth, i)
        if moving.any():
            keys = voxels.grid.keys(drive.sweep(i).points[moving])
            np.add.at(counts, find(voxels.keys, keys), 1)
    return counts


def scores(voxels: VoxelMap, moving: NDArray[np.int64], static: NDArray[np.int64]) -> dict[str, float]:
    """Accuracies, %, over the voxels that both LiDARs hit, of a static set given by its keys.

    A voxel is dynamic if most of its points are. SA, DA: share of static voxels kept and of dynamic ones
    removed. AA, HA: their geometric and harmonic mean. point_DA: share of the moving points removed.
    """
    both = voxels.hit_by_both
    kept = (find(static, voxels.keys) >= 0)[both]
    moving, counts = moving[both], voxels.counts[both]
    dynamic = 2 * moving > counts
    sa, da = 100 * kept[~dynamic].mean(), 100 * (~kept[dynamic]).mean()
    return {
        "SA": float(sa),
        "DA": float(da),
        "AA": float(np.sqrt(sa * da)),
        "HA": float(2 * sa * da / (sa + da)),
        "point_DA": float(100 * moving[~kept].sum() / moving.sum()),
    }


def static_by_dufomap(drive: Drive, voxels: VoxelMap) -> NDArray[np.int64]:
    """Keys of the voxels that DUFOMap keeps: at most half of their points are dynamic to it."""
    from dufomap import dufomap

    origin = drive.origins[0]
    solver = dufomap(**DUFOMAP, num_threads=1)
    for i in progress(range(len(drive)), "DUFOMap, rays"):
        solver.run(drive.sweep(i).points - origin, _pose(drive.origins[i] - origin), cloud_transform=False)
    solver.oncePropagateCluster(if_propagate=True, if_cluster=False)
    removed = np.zeros(len(voxels.keys), dtype=np.int64)
    for i in progress(range(len(drive)), "DUFOMap, labels"):
        points = drive.sweep(i).points
        labels = solver.segment(points - origin, _pose(drive.origins[i] - origin), cloud_transform=False)
        np.add.at(removed, find(voxels.keys, voxels.grid.keys(points[labels == 1])), 1)
    return voxels.keys[2 * removed <= voxels.counts]


def _pose(place: NDArray[np.float64]) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, 3] = place
    return pose
