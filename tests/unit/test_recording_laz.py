"""Bursts on disk."""

from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recording_samples import START_NS, burst

from card.errors import CardError
from card.recording.burst import MAX_BURST_NS, Burst
from card.recording.laz import SCALE_M, read_burst, write_burst


@pytest.mark.parametrize("count", [0, 1, 5000])
def test_a_burst_comes_back(tmp_path: Path, count: int) -> None:
    before = burst(START_NS, count)
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, before)
    after = read_burst(path)
    assert after.t_ns == START_NS
    # Rounded to the scale, then multiplied in float64.
    np.testing.assert_allclose(after.points, before.points, rtol=0, atol=SCALE_M / 2 + 1e-9)
    for name in ("intensity", "ring", "offset_ns"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
        assert getattr(after, name).dtype == getattr(before, name).dtype
    np.testing.assert_array_equal(after.time_ns, START_NS + before.offset_ns.astype(np.int64))
    assert after.end_ns == (int(after.time_ns.max()) if count else START_NS)


@pytest.mark.parametrize("count", [0, 5000])
def test_intensity_is_left_out_where_it_is_not_wanted(tmp_path: Path, count: int) -> None:
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, burst(START_NS, count))
    whole, part = read_burst(path), read_burst(path, intensity=False)
    for name in ("points", "ring", "offset_ns"):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name))
    np.testing.assert_array_equal(part.intensity, np.zeros(count, dtype=np.uint8))
    assert part.intensity.dtype == whole.intensity.dtype


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-300, 300), min_size=3, max_size=30))
def test_coordinates_are_rounded_to_a_tenth_of_a_millimetre(
    tmp_path_factory: pytest.TempPathFactory, xs: list[float]
) -> None:
    count = len(xs) // 3
    points = np.array(xs[: 3 * count]).reshape(-1, 3)
    zeros = np.zeros(count, dtype=np.uint8)
    path = tmp_path_factory.mktemp("laz") / "7.laz"
    write_burst(path, Burst(7, points, zeros, zeros, np.zeros(count, dtype=np.uint32)))
    assert np.abs(read_burst(path).points - points).max() <= SCALE_M / 2 + 1e-9


def test_the_same_burst_gives_the_same_bytes(tmp_path: Path) -> None:
    paths = [tmp_path / name / f"{START_NS}.laz" for name in "ab"]
    for path in paths:
        path.parent.mkdir()
        write_burst(path, burst(START_NS))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with laspy.open(paths[0]) as file:
        assert str(file.header.version) == "1.4"
        assert file.header.scales.tolist() == [SCALE_M] * 3
        assert file.header.offsets.tolist() == [0.0] * 3


def test_bad_bursts_are_not_written(tmp_path: Path) -> None:
    path = tmp_path / f"{START_NS}.laz"
    good = burst(START_NS)
    nan = good.points.copy()
    nan[17, 1] = np.nan
    late = good.offset_ns.copy()
    late[3] = MAX_BURST_NS + 1
    for bad, message in (
        (Burst(START_NS, nan, good.intensity, good.ring, good.offset_ns), "not finite.*first is point 17"),
        (Burst(START_NS, good.points, good.intensity, good.ring, late), "point times outside the burst"),
        (
            Burst(START_NS, good.points, good.intensity, good.ring + np.uint8(1), good.offset_ns),
            "ring.*found 32",
        ),
        (Burst(START_NS, good.points, good.intensity[:-1], good.ring, good.offset_ns), "differ in length"),
        (Burst(5, good.points, good.intensity, good.ring, good.offset_ns), "under another time"),
    ):
        with pytest.raises(CardError, match=message):
            write_burst(path, bad)
        assert not path.exists()


def test_unreadable_laz_is_named(tmp_path: Path) -> None:
    path = tmp_path / f"{START_NS}.laz"
    with pytest.raises(CardError, match="no such burst"):
        read_burst(path)
    write_burst(path, burst(START_NS, 1000))
    whole = path.read_bytes()
    for length in (0, 100, 400, len(whole) // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(CardError, match=f"{START_NS}.laz: unreadable LAZ"):
            read_burst(path)


@pytest.mark.parametrize("version", ["1.2", "1.4"])
def test_laz_of_others_reads_as_laspy_reads_it(tmp_path: Path, version: str) -> None:
    """Other versions, scales, orders and more dimensions than ours; several chunks; files in turns."""
    rng = np.random.default_rng(3)
    paths = [tmp_path / f"{name}.laz" for name in (5, 6, 7)]
    for path, count, scale in zip(paths, (120_000, 7, 0), (1e-4, 3e-3, 1e-3), strict=True):
        header = laspy.LasHeader(version=version, point_format=6 if version == "1.4" else 3)
        header.scales, header.offsets = np.array([scale, 2 * scale, 5 * scale]), rng.normal(size=3)
        header.add_extra_dims(
            [
                laspy.ExtraBytesParams("offset_ns", np.uint32),
                laspy.ExtraBytesParams("beam", np.float32),
                laspy.ExtraBytesParams("ring", np.uint8),
            ]
        )
        las = laspy.LasData(header)
        las.xyz = rng.uniform(-80, 80, (count, 3))
        las.intensity = rng.integers(0, 256, count)
        las.ring, las.offset_ns = rng.integers(0, 32, count), rng.integers(0, 10**8, count)
        las.write(path)
    for path in (*paths, *paths):
        found, wanted = read_burst(path), laspy.read(path)
        np.testing.assert_array_equal(found.points, wanted.xyz)
        for name in ("intensity", "ring", "offset_ns"):
            np.testing.assert_array_equal(getattr(found, name), wanted[name])


def test_las_that_is_not_compressed_is_refused(tmp_path: Path) -> None:
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, burst(START_NS))
    las = laspy.read(path)
    with path.open("wb") as file:
        las.write(file, do_compress=False)
    with pytest.raises(CardError, match=r"unreadable LAZ.*found points are not compressed"):
        read_burst(path)


def test_a_header_that_promises_more_points_is_refused(tmp_path: Path) -> None:
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, burst(START_NS))
    raw = bytearray(path.read_bytes())
    for count in (10**6, 2**62):
        raw[247:255] = count.to_bytes(8, "little")
        path.write_bytes(raw)
        with pytest.raises(CardError, match=f"{START_NS}.laz: unreadable LAZ"):
            read_burst(path)


def test_laz_of_others_must_have_our_dimensions(tmp_path: Path) -> None:
    las = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    las.x = np.zeros(3)
    path = tmp_path / "5.laz"
    las.write(path)
    with pytest.raises(CardError, match=r"lacks a dimension.*wanted extra dimension ring, uint8"):
        read_burst(path)


def test_points_that_are_not_finite_are_found_when_read(tmp_path: Path) -> None:
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, burst(START_NS))
    # LAS holds integers: only a scale that is not finite makes such points. It is at byte 131.
    raw = bytearray(path.read_bytes())
    raw[131:139] = np.float64(np.nan).tobytes()
    path.write_bytes(raw)
    with pytest.raises(CardError, match=r"points that are not finite \(found 200 of 200"):
        read_burst(path)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("ring", 32, r"ring that the sensor does not have \(found 32"),
        ("offset_ns", MAX_BURST_NS + 1, "point times outside the burst"),
    ],
)
def test_points_that_no_sensor_has_are_found_when_read(
    tmp_path: Path, name: str, value: int, message: str
) -> None:
    path = tmp_path / f"{START_NS}.laz"
    write_burst(path, burst(START_NS))
    las = laspy.read(path)
    las[name][117] = value
    las.write(path)
    with pytest.raises(CardError, match=message):
        read_burst(path)


@pytest.mark.parametrize("name", ["0012.laz", "12a.laz", "-5.laz", "1_0.laz", "²3.laz"])
def test_names_are_time_stamps(tmp_path: Path, name: str) -> None:
    with pytest.raises(CardError, match="not a time stamp"):
        read_burst(tmp_path / name)
