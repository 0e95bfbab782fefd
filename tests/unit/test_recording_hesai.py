"""PandarXT-32 packets: there and back, and against a real recording."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from card.errors import CardError
from card.recording.bag.bursts import PacketCount, packet_bursts, packets_of
from card.recording.bag.clocks import relate_clock
from card.recording.bag.source import open_bag
from card.recording.hesai.angles import nominal_angles, read_channel_angles, write_channel_angles
from card.recording.hesai.decode import Columns, columns_of, points_of
from card.recording.hesai.encode import encode_packets, quantise_columns
from card.recording.hesai.packet import (
    CHANNEL_OFFSET_NS,
    CHANNELS,
    COLUMN_PERIOD_NS,
    DUAL_RETURN,
    packet_time_ns,
    parse_packets,
)
from card.recording.hesai.scans import burst_of, whole_scans

START_NS = 1_780_000_000_123_456_000


def turning(columns: int, turns: float, first: int = 0, seed: int = 0) -> tuple[Columns, int]:
    """Columns of a sensor with `columns` a turn at 10 Hz, and their period in ns."""
    period_ns = 100_000_000 // columns
    index = np.arange(round(columns * turns)) + first
    rng = np.random.default_rng(seed)
    return quantise_columns(
        np.radians(index * 360.0 / columns),
        START_NS + (index - first) * period_ns,
        rng.uniform(0.5, 100, (len(index), CHANNELS)),
        rng.integers(0, 256, (len(index), CHANNELS)).astype(np.uint8),
    ), period_ns


@settings(max_examples=40, deadline=None)
@given(
    columns=st.sampled_from([8, 90, 250, 360, 2000]),
    count=st.integers(1, 60),
    first=st.integers(0, 2000),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_is_encoded_is_decoded(columns: int, count: int, first: int, seed: int) -> None:
    before, period_ns = turning(columns, count / columns, first, seed)
    packets = encode_packets(before, column_period_ns=period_ns)
    again = parse_packets([packet.tobytes() for packet in packets], "test")
    after = columns_of(again, period_ns, "test")
    assert len(after) == -(-count // 8) * 8
    np.testing.assert_array_equal(after.azimuth[:count], before.azimuth)
    np.testing.assert_array_equal(after.distance[:count], before.distance)
    np.testing.assert_array_equal(after.reflectivity[:count], before.reflectivity)
    # A packet's time is in whole microseconds.
    assert np.abs(after.time_ns[:count] - before.time_ns).max() <= 500
    assert not after.distance[count:].any(), "filled up with columns without returns"


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 4_000_000_000))
def test_packet_times_are_utc(seconds: int) -> None:
    empty = np.zeros((1, 1, CHANNELS))
    columns = Columns(
        np.zeros(1, np.int64), np.array([seconds * 10**9]), empty.astype(np.uint16), empty.astype(np.uint8)
    )
    packets = encode_packets(columns, column_period_ns=COLUMN_PERIOD_NS)
    year, month, day, hour, minute, second = packets["utc"][0].tolist()
    # The packet's time is that of its last column's trigger, 7 columns after its first.
    last_ns = seconds * 10**9 + 7 * COLUMN_PERIOD_NS - 5_632
    wanted = np.datetime64(last_ns // 1000, "us").item()
    assert (year + 1900, month, day, hour, minute, second) == wanted.timetuple()[:6]
    assert abs(int(packet_time_ns(packets)[0]) - last_ns) <= 500


def test_ranges_are_quantised_and_bad_ones_are_no_return() -> None:
    ranges = np.full((1, CHANNELS), 10.0)
    ranges[0, :6] = [np.nan, np.inf, -3.0, 0.0, 262.2, 0.001]
    ranges[0, 6:9] = [262.14, 0.004, 12.3456]
    columns = quantise_columns(np.zeros(1), np.zeros(1, np.int64), ranges, np.zeros((1, CHANNELS), np.uint8))
    assert columns.distance[0, 0, :9].tolist() == [0, 0, 0, 0, 0, 0, 65535, 1, 3086]


def test_points_follow_the_formula_of_the_sensor_frame() -> None:
    columns = quantise_columns(
        np.radians([0.0, 90.0]),
        np.array([0, 50_000]),
        np.full((2, CHANNELS), 10.0),
        np.zeros((2, CHANNELS), np.uint8),
    )
    points = points_of(columns, nominal_angles())
    ring = 5  # ten degrees up
    np.testing.assert_allclose(
        points.points[ring], [0, 10 * np.cos(np.radians(10)), 10 * np.sin(np.radians(10))], atol=1e-12
    )
    np.testing.assert_allclose(points.points[32 + ring][:2], [10 * np.cos(np.radians(10)), 0], atol=1e-12)
    np.testing.assert_array_equal(points.ring, np.tile(np.arange(32), 2))
    np.testing.assert_array_equal(
        points.time_ns, np.concatenate([CHANNEL_OFFSET_NS, 50_000 + CHANNEL_OFFSET_NS])
    )


def test_identical_dual_returns_are_dropped() -> None:
    distance = np.zeros((1, 2, CHANNELS), np.uint16)
    distance[0, :, 0] = [100, 100]  # one return, sent twice
    distance[0, :, 1] = [100, 50]
    distance[0, :, 2] = [0, 50]
    columns = Columns(
        np.zeros(1, np.int64), np.zeros(1, np.int64), distance, np.zeros(distance.shape, np.uint8)
    )
    points = points_of(columns, nominal_angles())
    assert points.ring.tolist() == [0, 1, 1, 2]
    np.testing.assert_allclose(np.linalg.norm(points.points, axis=1), [0.4, 0.4, 0.2, 0.2])


@pytest.mark.parametrize("chunk", [1, 7, 100, 10_000])
def test_scans_are_cut_at_azimuth_zero(chunk: int) -> None:
    columns, _ = turning(90, 3.5, first=40)
    scans = list(whole_scans(columns[start : start + chunk] for start in range(0, len(columns), chunk)))
    assert [len(scan) for scan in scans] == [90, 90]
    assert all(scan.azimuth[0] == 0 and scan.azimuth[-1] == 35_600 for scan in scans)


def test_whole_turns_at_both_ends_count() -> None:
    columns, _ = turning(90, 3)
    assert [len(scan) for scan in whole_scans([columns])] == [90, 90, 90]


def test_a_silence_breaks_the_scan_it_is_in() -> None:
    columns, _ = turning(90, 4)
    keep = np.r_[0:110, 170:360]
    torn = Columns(
        columns.azimuth[keep], columns.time_ns[keep], columns.distance[keep], columns.reflectivity[keep]
    )
    assert [int(scan.time_ns[0] - START_NS) // 99_999_990 for scan in whole_scans([torn])] == [0, 2, 3]
    assert [len(scan) for scan in whole_scans([torn])] == [90, 90, 90]


def test_bursts_start_with_their_first_shot() -> None:
    columns, _ = turning(250, 1)
    burst = burst_of(columns, nominal_angles())
    assert burst.t_ns == START_NS + CHANNEL_OFFSET_NS[0]
    assert burst.offset_ns.min() == 0
    assert burst.end_ns - burst.t_ns == 249 * 400_000 + CHANNEL_OFFSET_NS[-1] - CHANNEL_OFFSET_NS[0]


def test_foreign_packets_are_refused() -> None:
    columns, period_ns = turning(90, 0.2)
    packets = encode_packets(columns, column_period_ns=period_ns)
    good = [packet.tobytes() for packet in packets]
    with pytest.raises(
        CardError, match=r"test, packet 1: packet of a wrong size .found 100 bytes, wanted 1080"
    ):
        parse_packets([good[0], good[1][:100]], "test")
    for field, value in (("protocol", (1, 4)), ("channels", 64), ("return_mode", 0x3B), ("start", (0, 0))):
        bad = packets.copy()
        bad[field][2] = value
        with pytest.raises(CardError, match=f"packet 2: packet with an unknown {field}"):
            parse_packets([packet.tobytes() for packet in bad], "test")
    bad = packets.copy()
    bad["blocks"]["azimuth"][1, 3] = 36_000
    with pytest.raises(CardError, match="packet 1: packet with an unknown azimuth"):
        parse_packets([packet.tobytes() for packet in bad], "test")
    mixed = packets.copy()
    mixed["return_mode"][1:] = DUAL_RETURN
    with pytest.raises(CardError, match="packet 1: return mode changes"):
        columns_of(mixed, period_ns, "test")


def test_uneven_columns_cannot_share_a_packet() -> None:
    columns, period_ns = turning(90, 0.5)
    columns.time_ns[10] += 5_000
    with pytest.raises(CardError, match="packet 1: columns of a packet are not evenly spaced"):
        encode_packets(columns, column_period_ns=period_ns)


def test_packet_losses_are_counted() -> None:
    count = PacketCount()
    count.add(np.array([2**32 - 2, 2**32 - 1, 0], dtype=np.uint32))
    assert count.lost == 0
    count.add(np.array([1, 4, 5], dtype=np.uint32))
    count.add(np.array([7], dtype=np.uint32))
    assert (count.packets, count.lost) == (7, 3)


def test_channel_angles_come_back_and_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "angles.csv"
    write_channel_angles(path, nominal_angles())
    np.testing.assert_allclose(
        read_channel_angles(path).elevation_rad, nominal_angles().elevation_rad, atol=1e-8
    )
    text = path.read_text()
    for bad, message in (
        (text.replace("32,-16.000000,0.000000\n", ""), "channels missing"),
        (text.replace("32,-16.000000", "31,-16.000000"), "line 33: channel given twice"),
        (text.replace("-16.000000", "down"), "line 33: bad row"),
        (text.replace("Elevation", "El"), "line 2: bad row"),
        (text.replace("-16.000000", "nan"), "line 33: channel given twice or not finite"),
    ):
        path.write_text(bad)
        with pytest.raises(CardError, match=message):
            read_channel_angles(path)
    with pytest.raises(CardError, match="unreadable channel angles"):
        read_channel_angles(tmp_path / "none.csv")


def test_the_real_recording_equals_its_reference(test_data: Path) -> None:
    scipy_spatial = pytest.importorskip("scipy.spatial")
    folder = test_data / "hesai_xt32"
    angles = read_channel_angles(folder / "calibration" / "PandarXT32.csv")
    pcd = next((folder / "xt32").glob("*.pcd")).read_bytes()
    mark = b"DATA binary\n"
    reference = (
        np.frombuffer(pcd[pcd.index(mark) + len(mark) :], dtype="<f4").reshape(-1, 3).astype(np.float64)
    )
    bag = next(path for path in (folder / "xt32").iterdir() if path.is_dir())
    count = PacketCount()
    with open_bag(bag, {"lidar_front": "/pandar_packets"}) as [source]:
        bursts = list(packet_bursts(source, angles, COLUMN_PERIOD_NS, None, count))
        chunks = [packets_of(message, "test")[0] for message, _ in source.messages()]
        clock = relate_clock(source)
    assert (count.packets, count.lost) == (2000, 0)
    # The sensor's clock runs freely in 2019, the host's stamps are of 2023.
    assert clock.offset_ns / 1e9 == pytest.approx(1_673_400_677 - 1_564_024_769, abs=1.0)
    assert 0 < clock.delay_ns < 1e6
    assert len(bursts) == 3
    scans = list(whole_scans(columns_of(chunk, COLUMN_PERIOD_NS, "test") for chunk in chunks))
    assert np.count_nonzero(scans[-1].distance) == 121_648

    last = bursts[-1]
    assert len(last) == len(reference) == 63_021
    distance, _ = scipy_spatial.cKDTree(last.points).query(reference)
    assert np.median(distance) < 1e-7
    assert distance.max() < 8.1e-3
    for burst in bursts:
        assert (burst.end_ns - burst.t_ns) / 1e6 == pytest.approx(100.0, abs=0.05)
        assert set(np.unique(burst.ring)) <= set(range(32))
