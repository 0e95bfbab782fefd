"""The static voxel set of a simulated drive against what each of its points really met."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from card.artifacts import progress, read_arrays
from card.ground_truth.sweeps import Drive
from card.ground_truth.voxel_map import VoxelMap, build_voxel_map
from card.ground_truth.voxels import VoxelGrid, find
from card.recording.burst import Burst
from card.recording.paths import LIDARS

#: DUFOMap's own defaults for 10 cm voxels: inflation of hits (m) and of the unknown (voxels).
DUFOMAP = {"resolution": 0.1, "d_s": 0.2, "d_p": 2}


class TrueDrive(Drive):
    """A drive that knows which of its points move. truth : folder of the drive's truth."""

    def __init__(self, truth: Path, *arguments: Any) -> None:
        self._truth = {
            lidar: {int(file.stem): file for file in (truth / "bursts" / lidar).glob("*.npz")}
            for lidar in LIDARS
        }
        self._moving: dict[int, NDArray[np.bool_]] = {}
        super().__init__(*arguments)

    def moving(self, i: int) -> NDArray[np.bool_]:
        """(N,) whether each point of sweep `i` moves."""
        if i not in self._moving:
            self._read(i)
        return self._moving[i]

    def _takes_part(self, i: int, burst: Burst) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        real, inside = super()._takes_part(i, burst)
        # A bag's sweeps begin with their first packet, up to a packet after the simulated ones.
        files = self._truth[self.sensor(i)]
        file = files[min(files, key=lambda t_ns: abs(t_ns - int(self.start_ns[i])))]
        self._moving[i] = read_arrays(file, "truth_burst")["dynamic"][real & inside]
        return real, inside


def map_of(drive: TrueDrive, settings: Mapping[str, Any]) -> tuple[VoxelMap, NDArray[np.int64]]:
    """The voxel map of a drive, and how many points (V,) of each voxel move."""
    grid = VoxelGrid.around(drive.trajectory, settings["voxel_size_m"])
    moving = []

    def bursts() -> Iterator[tuple[int, bool, NDArray[np.float64]]]:
        for i in progress(range(len(drive)), "map"):
            points = drive.sweep(i).points
            moving.append(grid.keys(points[drive.moving(i)]))
            yield i, bool(drive.front[i]), points

    voxels = build_voxel_map(bursts(), drive.origins, grid, settings)
    counts = np.zeros(len(voxels.keys), dtype=np.int64)
    np.add.at(counts, find(voxels.keys, np.concatenate(moving)), 1)
    return voxels, counts


def scores(voxels: VoxelMap, moving: NDArray[np.int64], static: NDArray[np.int64]) -> dict[str, float]:
    """Accuracies, %, over the voxels that both LiDARs hit, of a static set given by its keys.

    A voxel is dynamic if most of its points are. SA, DA: share of static voxels kept and of dynamic ones
    removed. AA, HA: their geometric and harmonic mean. point_DA: share of all moving points of the drive
    removed, by whatever test; point_DA_two_lidars: of those in voxels that both LiDARs hit.
    dynamic_pct: share of the points of kept voxels that move.
    """
    both = voxels.hit_by_both
    every = find(static, voxels.keys) >= 0
    survive = moving[every].sum() / moving.sum()
    kept, moving, counts = every[both], moving[both], voxels.counts[both]
    dynamic = 2 * moving > counts
    sa, da = 100 * kept[~dynamic].mean(), 100 * (~kept[dynamic]).mean()
    return {
        "SA": float(sa),
        "DA": float(da),
        "AA": float(np.sqrt(sa * da)),
        "HA": float(2 * sa * da / (sa + da)),
        "point_DA": float(100 * (1 - survive)),
        "point_DA_two_lidars": float(100 * moving[~kept].sum() / moving.sum()),
        "dynamic_pct": float(100 * moving[kept].sum() / counts[kept].sum()),
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
