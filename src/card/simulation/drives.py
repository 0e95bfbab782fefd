"""The simulated drives, those of the demo and further ones: what each one's world and trip are like."""

import math
from dataclasses import dataclass

import numpy as np

from card.errors import CardError
from card.simulation.road import CrossSection

TOWN = CrossSection(
    half_width=3.6, side_width=2.8, kerb=0.12, side_slope=-0.02, lane=1.75, paved=True, bank=0.025
)
ITALIAN_TOWN = CrossSection(
    half_width=3.4, side_width=2.2, kerb=0.10, side_slope=-0.02, lane=1.65, paved=True, bank=0.025
)
RURAL = CrossSection(
    half_width=2.9, side_width=4.0, kerb=0.0, side_slope=-0.07, lane=1.45, paved=True, bank=0.05
)
TRACK = CrossSection(
    half_width=2.2, side_width=4.0, kerb=0.0, side_slope=-0.04, lane=0.2, paved=False, bank=0.03, ruts=0.04
)


@dataclass(frozen=True)
class Drive:
    """One drive.

    session : its calibration session.  starts : time of day, h UTC.
    bend : largest curvature of an open road, 1/m; ``circuit`` (straight m, radius m) makes a closed one.
    road_class : ISO 8608.  speeds : knots (s after the cameras start, m/s).
    bump_spacing, pothole_spacing, patch_spacing, manhole_spacing : metres from one to the next; 0 for none.
    house_depth, tree_spacing : metres; 0 for none.
    crossing_s : when walkers cross before the car, s after the cameras start; None for never.
    walker_spacing : metres between walkers along the road.  oncoming_s, parked_spacing : s, m between cars.
    leader, follower : a car ahead of us in our lane, one behind us.
    loads : what gets in: (s after the cameras start, kg, x and y in ``rig``).
    night : dark, with street lamps and headlights.
    lasts_s : no scale's recording is longer.
    bag : delivered as a rosbag2 with packets.
    """

    session: str
    starts: float
    country: str
    place: str
    section: CrossSection
    road_class: str
    speeds: tuple[tuple[float, float], ...]
    bend: float = 0.0
    circuit: tuple[float, float] | None = None
    bump_spacing: float = 0.0
    pothole_spacing: float = 0.0
    patch_spacing: float = 0.0
    manhole_spacing: float = 0.0
    house_depth: float = 0.0
    tree_spacing: float = 0.0
    crossing_s: float | None = None
    walker_spacing: float = 0.0
    oncoming_s: float = 0.0
    parked_spacing: float = 0.0
    leader: bool = False
    follower: bool = False
    loads: tuple[tuple[float, float, float, float], ...] = ()
    night: bool = False
    lasts_s: float = math.inf
    bag: bool = False

    @property
    def day(self) -> str:
        """Drive day, ISO date."""
        return self.session[:10]

    @property
    def start_ns(self) -> int:
        """When it starts, ns since 1970."""
        midnight = int(np.datetime64(self.day, "ns").astype(np.int64))
        return midnight + round(self.starts * 3600) * 1_000_000_000


DRIVES = {
    "de_town_bumps": Drive(
        session="2026-04-14-start",
        starts=9.0,
        country="DE",
        place="Musterstadt",
        section=TOWN,
        road_class="B",
        speeds=(
            (-2, 7.5),
            (-0.5, 6.0),
            (1.6, 3.5),
            (2.9, 0.0),
            (4.1, 0.0),
            (6.5, 4.5),
            (9, 8.0),
            (30, 8.0),
            (40, 6.0),
        ),
        bend=0.012,
        bump_spacing=42.0,
        pothole_spacing=95.0,
        patch_spacing=19.0,
        manhole_spacing=31.0,
        house_depth=8.0,
        tree_spacing=28.0,
        crossing_s=2.9,
        walker_spacing=16.0,
        oncoming_s=5.0,
        parked_spacing=24.0,
        follower=True,
    ),
    "de_rural_potholes": Drive(
        session="2026-04-14-mid",
        starts=12.8,
        country="DE",
        place="Landkreis Musterland",
        section=RURAL,
        road_class="D",
        speeds=((-4, 7.0), (0, 4.0), (5, 3.5), (9, 7.0), (20, 7.5), (24, 2.0), (27, 2.0), (32, 7.0)),
        bend=0.015,
        pothole_spacing=7.0,
        patch_spacing=13.0,
        tree_spacing=9.0,
        walker_spacing=45.0,
        oncoming_s=11.0,
    ),
    "de_gravel_offroad": Drive(
        session="2026-04-14-end",
        starts=16.0,
        country="DE",
        place="Musterforst",
        section=TRACK,
        road_class="E",
        speeds=((-4, 5.0), (0, 4.5), (6, 5.0), (15, 6.0), (30, 4.0)),
        bend=0.018,
        bump_spacing=37.0,
        pothole_spacing=15.0,
        tree_spacing=6.0,
        walker_spacing=55.0,
        leader=True,
        follower=True,
        bag=True,
    ),
    "it_town_revisit": Drive(
        session="2026-05-19-start",
        starts=9.0,
        country="IT",
        place="Borgo Esempio",
        section=ITALIAN_TOWN,
        road_class="B",
        speeds=((-4, 7.0), (0, 6.0), (5, 6.0), (8, 7.5)),
        circuit=(62.0, 15.0),
        bump_spacing=52.0,
        pothole_spacing=61.0,
        patch_spacing=23.0,
        manhole_spacing=27.0,
        house_depth=5.0,
        tree_spacing=30.0,
        crossing_s=3.0,
        walker_spacing=18.0,
        oncoming_s=9.0,
        parked_spacing=35.0,
    ),
    "it_zero_shot": Drive(
        session="2026-05-19-end",
        starts=20.5,
        country="IT",
        place="Villa Prova",
        section=ITALIAN_TOWN,
        road_class="C",
        speeds=((-4, 8.0), (0, 6.5), (5, 6.0), (9, 8.5), (25, 8.5), (32, 4.0), (38, 8.0)),
        bend=0.010,
        bump_spacing=58.0,
        pothole_spacing=19.0,
        patch_spacing=17.0,
        manhole_spacing=33.0,
        house_depth=7.0,
        tree_spacing=18.0,
        crossing_s=3.5,
        walker_spacing=20.0,
        oncoming_s=6.0,
        parked_spacing=20.0,
        leader=True,
        follower=True,
        night=True,
    ),
}


#: What no demo shows: long enough, slow enough or dark enough to measure a stage on.
FURTHER_DRIVES = {
    # 600 m round a block and a little more, past other cars.
    "it_town_loop": Drive(
        session="2026-05-19-start",
        starts=10.5,
        country="IT",
        place="Borgo Esempio",
        section=ITALIAN_TOWN,
        road_class="A",
        speeds=((-6, 9.0), (0, 9.5), (10, 8.5), (18, 9.5), (34, 8.2), (44, 10.0), (60, 9.0)),
        circuit=(205.0, 30.0),
        bump_spacing=75.0,
        pothole_spacing=60.0,
        patch_spacing=40.0,
        manhole_spacing=35.0,
        house_depth=7.0,
        tree_spacing=30.0,
        walker_spacing=40.0,
        oncoming_s=6.0,
        parked_spacing=22.0,
        leader=True,
        follower=True,
        lasts_s=72.0,
    ),
    # Walking pace: a stop of five seconds, walkers along the car.
    "de_town_slow": Drive(
        session="2026-04-14-mid",
        starts=11.5,
        country="DE",
        place="Musterstadt",
        section=TOWN,
        road_class="B",
        speeds=((-5, 3.0), (0, 1.6), (6, 1.4), (8, 0.0), (13, 0.0), (16, 1.3), (30, 2.2), (45, 1.2)),
        bend=0.012,
        bump_spacing=18.0,
        pothole_spacing=11.0,
        patch_spacing=14.0,
        manhole_spacing=25.0,
        house_depth=8.0,
        tree_spacing=28.0,
        crossing_s=10.0,
        walker_spacing=6.0,
        oncoming_s=7.0,
        parked_spacing=18.0,
        loads=((9.5, 85.0, 0.4, -1.5),),
        follower=True,
    ),
}


def drive_named(name: str) -> Drive:
    """The drive with this id; CardError for another name."""
    drives = DRIVES | FURTHER_DRIVES
    if name not in drives:
        raise CardError("unknown simulated drive", found=name, wanted=", ".join(drives))
    return drives[name]
