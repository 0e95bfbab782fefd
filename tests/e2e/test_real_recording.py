"""A LiDAR-only sequence of a real XT32 recording goes through the chain as far as its modalities reach."""

import json
import shutil
from pathlib import Path

from project import Project

from card.packaging.reader import Release

DESCRIPTION = """
id: real_xt32
rig: static indoor PandarXT-32
day: "2023-01-11"
place: indoor
country: DE
sensors:
  lidar_front: {model: PandarXT-32, clock: free_running, deskewed: false}
bag:
  folder: bag
  topics: {lidar_front: /pandar_packets}
  channel_angles: {lidar_front: PandarXT32.csv}
"""
CELLS = "real_xt32|recordings/real_xt32|rosbag2|DE|indoor|-|indoor|day|split|false|lidar_front|-"


def test_a_lidar_only_sequence_is_released(fresh: Project, test_data: Path) -> None:
    recording = fresh.root / "recordings" / "real_xt32"
    shutil.copytree(test_data / "hesai_xt32" / "xt32" / "1673400677802009732", recording / "bag")
    shutil.copy(test_data / "hesai_xt32" / "calibration" / "PandarXT32.csv", recording)
    (recording / "recording.yaml").write_text(DESCRIPTION)
    sheet = fresh.root / "config" / "sequences.tsv"
    sheet.write_text(sheet.read_text() + CELLS.replace("|", "\t") + "\n")

    fresh.build("release", "--config", "sequences=real_xt32")

    made = {path.name for path in (fresh.root / "results" / "real_xt32").glob("*.report.json")}
    assert made == {"import_bag.report.json", "ingest.report.json", "package.report.json"}
    clock = json.loads((fresh.root / "results" / "real_xt32" / "import_bag.report.json").read_text())
    assert any("free-running" in note for note in clock["notes"])

    release = Release(fresh.root / "results" / "release-subset" / "card-germany")
    assert release.frames() == []
    # Three whole scans; the cut ends are dropped. The last one is the reference of the vendor's decoder.
    clouds = [release.burst("real_xt32", burst) for burst in range(3)]
    assert len(clouds[-1]) == 63_021
