"""The demo drives: what each one's world and trip are like."""

from dataclasses import dataclass

from card.errors import CardError
from card.simulation.road import CrossSection

TOWN = CrossSection(half_width=3.6, side_width=2.8, kerb=0.12, side_slope=-0.02, lane=1.75, paved=True)
ITALIAN_TOWN = CrossSection(
    half_width=3.4, side_width=2.2, kerb=0.10, side_slope=-0.02, lane=1.65, paved=True
)
RURAL = CrossSection(half_width=2.9, side_width=4.0, kerb=0.0, side_slope=-0.07, lane=1.45, paved=True)
TRACK = CrossSection(half_width=2.2, side_width=4.0, kerb=0.0, side_slope=-0.04, lane=0.2, paved=False)


@dataclass(frozen=True)
class Drive:
    """One drive.

    session : its calibration session.  starts : time of day, h UTC.
    bend : largest curvature of an open road, 1/m; ``circuit`` (straight m, radius m) makes a closed one.
    road_class : ISO 8608.  speeds : knots (s after the cameras start, m/s).
    bump_spacing, pothole_spacing : metres from one to the next; 0 for none.
    house_depth, tree_spacing : metres; 0 for none.
    crossing_s : when walkers cross before the car, s after the cameras start; None for never.
    walker_spacing : metres between walkers along the road.  oncoming_s, parked_spacing : s, m between cars.
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
    house_depth: float = 0.0
    tree_spacing: float = 0.0
    crossing_s: float | None = None
    walker_spacing: float = 0.0
    oncoming_s: float = 0.0
    parked_spacing: float = 0.0
    leader: bool = False
    bag: bool = False

    @property
    def day(self) -> str:
        """Drive day, ISO date."""
        return self.session[:10]


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
        house_depth=8.0,
        tree_spacing=28.0,
        crossing_s=2.9,
        walker_spacing=16.0,
        oncoming_s=5.0,
        parked_spacing=24.0,
    ),
    "de_rural_potholes": Drive(
        session="2026-04-14-mid",
        starts=12.8,
        country="DE",
        place="Landkreis Musterland",
        section=RURAL,
        road_class="C",
        speeds=((-4, 7.0), (0, 4.0), (5, 3.5), (9, 7.0), (20, 7.5), (24, 2.0), (27, 2.0), (32, 7.0)),
        bend=0.015,
        pothole_spacing=7.0,
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
        house_depth=5.0,
        tree_spacing=30.0,
        crossing_s=3.0,
        walker_spacing=18.0,
        oncoming_s=9.0,
        parked_spacing=35.0,
    ),
    "it_zero_shot": Drive(
        session="2026-05-19-mid",
        starts=13.0,
        country="IT",
        place="Villa Prova",
        section=ITALIAN_TOWN,
        road_class="C",
        speeds=((-4, 8.0), (0, 6.5), (5, 6.0), (9, 8.5), (25, 8.5), (32, 4.0), (38, 8.0)),
        bend=0.010,
        bump_spacing=58.0,
        pothole_spacing=19.0,
        house_depth=7.0,
        tree_spacing=18.0,
        crossing_s=3.5,
        walker_spacing=20.0,
        oncoming_s=6.0,
        parked_spacing=20.0,
        leader=True,
    ),
}


def drive_named(name: str) -> Drive:
    """The drive of one of the demo's ids; CardError for another name."""
    if name not in DRIVES:
        raise CardError("unknown demo drive", found=name, wanted=", ".join(DRIVES))
    return DRIVES[name]
