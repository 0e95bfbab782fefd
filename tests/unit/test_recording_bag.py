"""Bags: written, imported, compared; and what is wrong with bad ones."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from recording_samples import description, jpeg

from card.artifacts import default_settings, inventory, read_table
from card.errors import CardError
from card.recording.bag.import_bag import import_bag
from card.recording.bag.messages import CLOUD, IMAGE, typestore
from card.recording.bag.write import BagWriter, write_bag
from card.recording.hesai.angles import ChannelAngles, nominal_angles, write_channel_angles
from card.recording.hesai.encode import encode_packets, quantise_columns
from card.recording.hesai.packet import CHANNELS, packet_time_ns
from card.recording.laz import read_burst
from card.recording.paths import list_bursts, list_images

START_NS = 1_776_000_000_000_000_000
COLUMNS, TURNS = 80, 3
PERIOD_NS = 100_000_000 // COLUMNS
SENSOR_BEHIND_NS = 5_000_000_000_000
SETTINGS = default_settings("ingest")
TOPICS = {
    "lidar_front": "/front/packets",
    "lidar_rear": "/rear/packets",
    "camera_left": "/left",
    "imu": "/imu",
}
ANGLES = ChannelAngles(nominal_angles().elevation_rad + 0.01, nominal_angles().azimuth_rad + 0.002)


def ranges() -> np.ndarray:
    return np.random.default_rng(3).uniform(1.0, 80.0, (COLUMNS * TURNS, CHANNELS))


def fill(bag: BagWriter, behind_ns: int = 0) -> None:
    """Three turns of two LiDARs whose clocks are behind, five images, IMU in disorder."""
    index = np.arange(COLUMNS * TURNS)
    time_ns = START_NS + index * PERIOD_NS - behind_ns
    columns = quantise_columns(
        np.radians(index * 360 / COLUMNS), time_ns, ranges(), np.full((len(index), CHANNELS), 9, np.uint8)
    )
    packets = encode_packets(columns, column_period_ns=PERIOD_NS)
    host_ns = packet_time_ns(packets) + behind_ns + 300_000
    for topic in (TOPICS["lidar_front"], TOPICS["lidar_rear"]):
        # Messages end anywhere in a turn.
        for start in range(0, len(packets), 7):
            bag.packets(topic, packets[start : start + 7], host_ns[start : start + 7])
    for index_ in range(5):
        bag.image(TOPICS["camera_left"], START_NS + index_ * 100_000_000, jpeg(seed=index_))
    for t_ns in (START_NS + 20_000_000, START_NS, START_NS + 10_000_000):
        bag.imu(TOPICS["imu"], t_ns, np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.5, 9.8]))


def recording(
    tmp_path: Path, behind_ns: int = 0, clock: str = "synchronised", storage: Any = "sqlite3"
) -> Path:
    root = tmp_path / "raw"
    root.mkdir()
    with write_bag(root / "bag", storage) as bag:
        fill(bag, behind_ns)
    write_channel_angles(root / "front.csv", ANGLES)
    described = description(tuple(TOPICS))
    for lidar in ("lidar_front", "lidar_rear"):
        described["sensors"][lidar] |= {"clock": clock, "column_period_ns": PERIOD_NS}
    described["bag"] = {"folder": "bag", "topics": TOPICS, "channel_angles": {"lidar_front": "front.csv"}}
    (root / "recording.yaml").write_text(yaml.safe_dump(described))
    return root


def run(root: Path) -> Path:
    out = root.parent / "results" / "recording"
    import_bag(recording=root, out=out, report=root.parent / "import_bag.report.json", settings=SETTINGS)
    return out


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_bag_becomes_a_recording(tmp_path: Path, storage: str) -> None:
    root = recording(tmp_path, storage=storage)
    out = run(root)

    bursts = [read_burst(path) for path in list_bursts(out, "lidar_front")]
    assert len(bursts) == TURNS
    assert abs(bursts[0].t_ns - START_NS) < 1_000
    quantised = np.round(ranges() / 0.004) * 0.004
    for turn, burst in enumerate(bursts):
        wanted = quantised[turn * COLUMNS : (turn + 1) * COLUMNS].ravel()
        np.testing.assert_allclose(np.linalg.norm(burst.points, axis=1), wanted, atol=1e-4)
        elevation = np.arcsin(burst.points[:, 2] / np.linalg.norm(burst.points, axis=1))
        np.testing.assert_allclose(elevation, ANGLES.elevation_rad[burst.ring], atol=1e-4)
    rear = read_burst(list_bursts(out, "lidar_rear")[0])
    elevation = np.arcsin(rear.points[:, 2] / np.linalg.norm(rear.points, axis=1))
    np.testing.assert_allclose(elevation, nominal_angles().elevation_rad[rear.ring], atol=1e-4)

    assert [path.read_bytes() for path in list_images(out, "camera_left")] == [jpeg(seed=i) for i in range(5)]
    imu = read_table(out / "imu.parquet", "imu").to_pydict()
    assert imu["t_ns"] == [START_NS, START_NS + 10_000_000, START_NS + 20_000_000]
    assert imu["accel_z"] == [9.8] * 3
    assert imu["gyro_y"] == [0.2] * 3
    described = yaml.safe_load((out / "recording.yaml").read_text())
    assert "bag" not in described
    assert described["sensors"]["lidar_front"]["column_period_ns"] == PERIOD_NS


def test_the_same_bag_gives_the_same_bytes(tmp_path: Path) -> None:
    root = recording(tmp_path)
    first = inventory(run(root))
    report = (tmp_path / "import_bag.report.json").read_bytes()
    assert inventory(run(root)) == first
    assert (tmp_path / "import_bag.report.json").read_bytes() == report


def test_a_free_running_clock_is_reported_and_put_on_the_hosts(tmp_path: Path) -> None:
    root = recording(tmp_path, behind_ns=SENSOR_BEHIND_NS, clock="free_running")
    out = run(root)
    # The least delay of the network, 0.3 ms here, cannot be told from the clock's offset.
    # The packets' own time is in whole microseconds; the first shot comes 368 ns into its round.
    start_ns = int(list_bursts(out, "lidar_front")[0].stem)
    assert start_ns == pytest.approx(START_NS + 300_000 + 368, abs=500, rel=0)
    report = json.loads((tmp_path / "import_bag.report.json").read_text())
    figures = {figure["name"]: figure["value"] for figure in report["figures"]}
    assert figures["lidar_front_clock_offset"] == pytest.approx(SENSOR_BEHIND_NS / 1e9 + 300e-6, abs=2e-6)
    assert any("lidar_front is free-running" in note for note in report["notes"])
    assert report["counts"]["lidar_front_packets_lost"] == 0


def test_a_clock_that_is_off_must_be_declared(tmp_path: Path) -> None:
    root = recording(tmp_path, behind_ns=SENSOR_BEHIND_NS)
    with pytest.raises(CardError, match=r"lidar_front is not synchronised.*5000.000 s behind.*free_running"):
        run(root)
    assert not (tmp_path / "results" / "recording").exists()


def edited(root: Path, **bag: Any) -> Path:
    path = root / "recording.yaml"
    described = yaml.safe_load(path.read_text())
    described["bag"] |= bag
    path.write_text(yaml.safe_dump(described))
    return root


def test_bad_bags_are_told(tmp_path: Path) -> None:
    root = recording(tmp_path)
    with pytest.raises(CardError, match="nowhere: unreadable bag"):
        run(edited(root, folder="nowhere"))
    with pytest.raises(CardError, match=r"no topic of imu in the bag.*'/front/packets'"):
        run(edited(root, folder="bag", topics=TOPICS | {"imu": "/imu2"}))
    with pytest.raises(
        CardError, match=r"wrong message type for imu .found .'sensor_msgs/msg/CompressedImage'"
    ):
        run(edited(root, topics=TOPICS | {"imu": "/left"}))
    with pytest.raises(CardError, match=r"sensors and topics disagree .found .'imu'. only in one"):
        run(edited(root, topics={name: topic for name, topic in TOPICS.items() if name != "imu"}))
    with pytest.raises(CardError, match="unreadable channel angles"):
        run(edited(root, topics=TOPICS, channel_angles={"lidar_front": "no.csv"}))
    (root / "recording.yaml").write_text(yaml.safe_dump(description()))
    with pytest.raises(CardError, match="recording has no bag section"):
        run(root)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_bag_that_is_cut_off_is_refused(tmp_path: Path, storage: str) -> None:
    root = recording(tmp_path, storage=storage)
    [data] = [path for path in (root / "bag").iterdir() if path.suffix in (".db3", ".mcap")]
    whole = data.read_bytes()
    for length in (0, 50, 4096, len(whole) // 2):
        data.write_bytes(whole[:length])
        with pytest.raises(CardError, match="raw/bag: unreadable bag"):
            run(root)


def test_a_bag_with_fewer_messages_than_it_says_is_refused(tmp_path: Path) -> None:
    root = recording(tmp_path)
    metadata = root / "bag" / "metadata.yaml"
    text = metadata.read_text()
    assert "message_count: 5" in text, "packets and images"
    metadata.write_text(text.replace("message_count: 5", "message_count: 6"))
    with pytest.raises(CardError, match=r"bag is not whole .found 5 messages, wanted 6"):
        run(root)


def test_two_images_of_one_time_are_refused(tmp_path: Path) -> None:
    root = tmp_path / "raw"
    root.mkdir()
    with write_bag(root / "bag") as bag:
        for seed in range(2):
            bag.image("/left", START_NS, jpeg(seed=seed))
    described = description(("camera_left",)) | {"bag": {"folder": "bag", "topics": {"camera_left": "/left"}}}
    (root / "recording.yaml").write_text(yaml.safe_dump(described))
    with pytest.raises(CardError, match=f"/left.*two messages of the same time .found {START_NS}"):
        run(root)


def raw_topic_bag(tmp_path: Path, sensor: str, kind: str, messages: list[Any]) -> Path:
    """A recording with one topic of any kind."""
    from rosbags.rosbag2 import Writer

    root = tmp_path / "raw"
    root.mkdir()
    with Writer(root / "bag", version=9) as writer:
        connection = writer.add_connection("/topic", kind, typestore=typestore())
        for message in messages:
            stamp = message.header.stamp
            host_ns = stamp.sec * 10**9 + stamp.nanosec + 120_000_000
            writer.write(connection, host_ns, typestore().serialize_cdr(message, kind))
    described = description((sensor,)) | {"bag": {"folder": "bag", "topics": {sensor: "/topic"}}}
    (root / "recording.yaml").write_text(yaml.safe_dump(described))
    return root


def test_clouds_become_bursts(tmp_path: Path) -> None:
    from test_recording_cloud import STAMP_NS, basic, cloud

    root = raw_topic_bag(tmp_path, "lidar_front", CLOUD, [cloud(basic(t=("u4", [50, 99_000_000, 7])))])
    [path] = list_bursts(run(root), "lidar_front")
    burst = read_burst(path)
    assert burst.t_ns == STAMP_NS + 7
    assert burst.offset_ns.tolist() == [0, 43, 98_999_993]
    np.testing.assert_allclose(burst.points, [[3, 4, 5], [1, 2, 3], [2, 3, 4]], atol=1e-9)


@pytest.mark.parametrize(("encoding", "channels"), [("rgb8", 3), ("bgr8", 3), ("mono8", 1)])
def test_plain_images_become_jpegs(tmp_path: Path, encoding: str, channels: int) -> None:
    from PIL import Image

    types = typestore().types
    pixels = np.zeros((16, 24, channels), np.uint8)
    pixels[..., 0] = 200  # red for rgb8, blue for bgr8
    time = types["builtin_interfaces/msg/Time"](sec=START_NS // 10**9, nanosec=0)
    message = types[IMAGE](
        header=types["std_msgs/msg/Header"](stamp=time, frame_id="left"),
        height=16,
        width=24,
        encoding=encoding,
        is_bigendian=0,
        step=24 * channels,
        data=pixels.ravel(),
    )
    [path] = list_images(run(raw_topic_bag(tmp_path, "camera_left", IMAGE, [message])), "camera_left")
    with Image.open(path) as image:
        assert image.size == (24, 16)
        mean = np.asarray(image.convert("RGB")).mean(axis=(0, 1))
    wanted = {"rgb8": [200, 0, 0], "bgr8": [0, 0, 200], "mono8": [200, 200, 200]}[encoding]
    np.testing.assert_allclose(mean, wanted, atol=4)
