"""All that a drive's LiDARs and cameras see, in runs of sweeps or images that processes share."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from card.artifacts import progress, write_arrays
from card.artifacts.processes import in_processes
from card.recording.laz import write_burst
from card.recording.paths import burst_path
from card.simulation.bodies import ego_body
from card.simulation.lidar import Lidar, burst_starts
from card.simulation.photographs import Photographer, Shown, exposures, write_labels
from card.simulation.raycast import Scene, Tracer
from card.simulation.rig import CAMERAS, LIDARS
from card.simulation.world import World

#: Sweeps or images that one process takes at a time.
_RUN = {**dict.fromkeys(LIDARS, 20), **dict.fromkeys(CAMERAS, 4)}


@dataclass(frozen=True)
class Run:
    """Sweeps or images ``numbers`` of one sensor."""

    sensor: str
    numbers: range


def write_sweeps(
    world: World, recording: Path, truth: Path, threads: int = 1, *, dual_returns: bool = False
) -> None:
    """All sweeps of both LiDARs, and for each what its points really met.

    threads : processes that share the work; the bytes do not depend on it.
    """
    for lidar in LIDARS:
        (recording / lidar).mkdir(parents=True)
        (truth / "bursts" / lidar).mkdir(parents=True)
    counts = {lidar: len(burst_starts(lidar, world.start_ns, world.scale.duration_s)) for lidar in LIDARS}
    _record(_Recorder(world, recording, truth, dual_returns), _runs(counts), threads)


def write_photographs(world: World, recording: Path, truth: Path, threads: int = 1) -> None:
    """Images of both cameras, ``annotations/``, ``privacy_labels.csv``, and the truth's ``boxes.parquet``.

    threads : as in `write_sweeps`.
    """
    for camera in CAMERAS:
        (recording / camera).mkdir(parents=True)
    runs = _runs({camera: len(exposures(world, camera)) for camera in CAMERAS})
    write_labels(world, _record(_Recorder(world, recording, truth), runs, threads), recording, truth)


def _runs(counts: dict[str, int]) -> list[Run]:
    return [
        Run(sensor, range(first, min(first + _RUN[sensor], count)))
        for sensor, count in counts.items()
        for first in range(0, count, _RUN[sensor])
    ]


def _record(recorder: "_Recorder", runs: list[Run], threads: int) -> list[Shown]:
    label = f"{recorder.world.name} sensors"
    done = progress(in_processes(recorder.record, runs, threads), label, len(runs))
    return [shown for found in done for shown in found]


@dataclass
class _Recorder:
    world: World
    recording: Path
    truth: Path
    dual_returns: bool = False

    def record(self, run: Run) -> list[Shown]:
        if run.sensor in CAMERAS:
            return self._photographer.photograph(run.sensor, run.numbers, self.recording)
        starts = burst_starts(run.sensor, self.world.start_ns, self.world.scale.duration_s)
        for number in run.numbers:
            self._sweep(run.sensor, starts[number], number)
        return []

    def _sweep(self, name: str, t_ns: int, number: int) -> None:
        burst, met = self._lidars[name].scan(t_ns, number)
        write_burst(burst_path(self.recording, name, t_ns), burst)
        arrays = {"dynamic": met.dynamic, "range_m": met.range_m, "surface": met.surface}
        write_arrays(self.truth / "bursts" / name / f"{t_ns}.npz", arrays, "truth_burst")

    # Made in the process that uses them.
    @cached_property
    def _tracer(self) -> Tracer:
        return Tracer(self.world.static, self.world.movers)

    @cached_property
    def _ego(self) -> Scene:
        return Scene(ego_body())

    @cached_property
    def _lidars(self) -> dict[str, Lidar]:
        return {
            name: Lidar(self.world, self._tracer, self._ego, name, dual=self.dual_returns) for name in LIDARS
        }

    @cached_property
    def _photographer(self) -> Photographer:
        return Photographer(self.world, self._tracer, self._ego)
