"""PointCloud2 in the spellings of several drivers."""

from typing import Any

import numpy as np
import pytest

from card.errors import CardError
from card.recording.bag.cloud import points_of_cloud
from card.recording.bag.messages import CLOUD, typestore

STAMP_NS = 1_700_000_000_250_000_000
CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


def cloud(fields: dict[str, tuple[str, Any]], *, dense: bool = True, padding: int = 0) -> Any:
    """A PointCloud2 with `fields` {name: (kind, values)} and some bytes between points."""
    types = typestore().types
    count = len(next(iter(fields.values()))[1])
    kinds = [kind for kind, _ in fields.values()]
    offsets = np.cumsum([0, *(np.dtype(kind).itemsize for kind in kinds)]).tolist()
    step = offsets[-1] + padding
    layout = np.dtype({"names": list(fields), "formats": kinds, "offsets": offsets[:-1], "itemsize": step})
    table = np.zeros(count, layout)
    for name, (_, values) in fields.items():
        table[name] = values
    time = types["builtin_interfaces/msg/Time"](sec=STAMP_NS // 10**9, nanosec=STAMP_NS % 10**9)
    field = types["sensor_msgs/msg/PointField"]
    message = types[CLOUD](
        header=types["std_msgs/msg/Header"](stamp=time, frame_id="lidar"),
        height=1,
        width=count,
        fields=[
            field(name=name, offset=offset, datatype=CODES[kind], count=1)
            for (name, (kind, _)), offset in zip(fields.items(), offsets, strict=False)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * count,
        data=np.frombuffer(table.tobytes(), dtype=np.uint8),
        is_dense=dense,
    )
    store = typestore()
    return store.deserialize_cdr(store.serialize_cdr(message, CLOUD), CLOUD)


def basic(**more: tuple[str, Any]) -> dict[str, tuple[str, Any]]:
    xyz = {axis: ("f4", [index + 1.0, index + 2.0, index + 3.0]) for index, axis in enumerate("xyz")}
    return xyz | {"intensity": ("f4", [0, 7, 255]), "ring": ("u2", [0, 5, 31])} | more


@pytest.mark.parametrize(
    ("name", "kind", "values"),
    [
        ("timestamp", "f8", STAMP_NS / 1e9 + np.array([0.0, 0.05, 0.0999])),
        ("timestamp", "f8", STAMP_NS + np.array([0.0, 5e7, 9.99e7])),
        ("time", "f4", [0.0, 0.05, 0.0999]),
        ("t", "u4", [0, 50_000_000, 99_900_000]),
        ("offset_time", "u4", [0, 50_000_000, 99_900_000]),
        ("time_stamp", "u4", [0, 50_000_000, 99_900_000]),
    ],
)
@pytest.mark.parametrize("padding", [0, 6])
def test_times_of_several_drivers(name: str, kind: str, values: Any, padding: int) -> None:
    points = points_of_cloud(cloud(basic(**{name: (kind, values)}), padding=padding), "test")
    # A float64 of seconds since 1970 is good to 0.24 microseconds, a float32 of 0.1 s to 7 ns.
    np.testing.assert_allclose(points.time_ns - STAMP_NS, [0, 50_000_000, 99_900_000], atol=300)
    assert points.points.tolist() == [[1, 2, 3], [2, 3, 4], [3, 4, 5]]
    assert points.ring.tolist() == [0, 5, 31]
    assert points.intensity.tolist() == [0, 7, 255]


def test_points_come_in_order_of_time() -> None:
    points = points_of_cloud(cloud(basic(t=("u4", [30, 10, 20]))), "test")
    assert (points.time_ns - STAMP_NS).tolist() == [10, 20, 30]
    assert points.ring.tolist() == [5, 31, 0]


def test_returns_that_are_none_are_left_out() -> None:
    fields = basic(t=("u4", [1, 2, 3])) | {axis: ("f4", [np.nan, 0.0, 4.0]) for axis in "xyz"}
    assert points_of_cloud(cloud(fields, dense=False), "test").points.tolist() == [[4, 4, 4]]
    with pytest.raises(CardError, match="test: points that are not finite in a dense cloud"):
        points_of_cloud(cloud(fields), "test")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (basic(), "cloud lacks time of each point: it cannot be deskewed without"),
        ({k: v for k, v in basic(t=("u4", [1, 2, 3])).items() if k != "ring"}, "cloud lacks ring"),
        ({k: v for k, v in basic(t=("u4", [1, 2, 3])).items() if k != "z"}, "cloud lacks a field.*wanted z"),
        ({k: v for k, v in basic(t=("u4", [1, 2, 3])).items() if k != "intensity"}, "cloud lacks intensity"),
        (basic(t=("u4", [1, 2, 3])) | {"intensity": ("f4", [0, 1, 300])}, "intensity out of range"),
    ],
)
def test_clouds_that_lack_something_are_refused(fields: dict[str, tuple[str, Any]], message: str) -> None:
    with pytest.raises(CardError, match=message):
        points_of_cloud(cloud(fields), "test")


@pytest.mark.parametrize("start", [0.0, STAMP_NS / 1e9])
def test_a_return_without_a_time_is_refused_and_one_that_is_none_is_not(start: float) -> None:
    times = start + np.array([0.0, np.nan, 0.09])
    with pytest.raises(CardError, match=r"points without a time \(found 1\)"):
        points_of_cloud(cloud(basic(time=("f8", times))), "test")
    lost = {axis: ("f4", [1.0, np.nan, 3.0]) for axis in "xyz"}
    points = points_of_cloud(cloud(basic(time=("f8", times)) | lost, dense=False), "test")
    assert points.ring.tolist() == [0, 31]
    np.testing.assert_allclose(points.time_ns - STAMP_NS, [0, 90_000_000], atol=500)
