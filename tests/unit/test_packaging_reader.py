"""The reader for users of a release: in a folder and over the web, with base dependencies only."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging_drive import FRAMES, build_tree
from range_server import served

from card.cli import main
from card.errors import CardError
from card.geometry import CameraModel, apply, rasterize
from card.packaging.reader import Release
from card.packaging.reader import files as reader_files

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_tree(tmp_path_factory.mktemp("reader"))


def test_a_file_over_the_web_takes_one_request_of_its_own_size(tree: Path) -> None:
    local = Release(tree)
    with served(tree) as server:
        release = Release(server.address)
        assert server.requests == [("/metadata/members.parquet", None)]
        for modality in ("camera_left", "ground_truth", "labels", "lidar_rear"):
            server.requests.clear()
            content = release.read("de_test", 3, modality)
            assert content == local.read("de_test", 3, modality)
            ((path, byte_range),) = server.requests
            assert path == f"/data/de_test/{modality}-000.tar"
            first, last = map(int, byte_range.removeprefix("bytes=").split("-"))
            assert last - first + 1 == len(content)


def test_tables_and_documents_are_fetched_once(tree: Path) -> None:
    with served(tree) as server:
        release = Release(server.address)
        for _ in range(2):
            assert [frame.number for frame in release.iterate("train")] == [0, 3]
            release.transform("world_from_camera_left", "de_test", 3)
        paths = [path for path, _ in server.requests]
        assert len(paths) == len(set(paths))


def test_a_repository_on_the_hub_is_read_by_its_name(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with served(tree) as server, served(tree) as storage:
        monkeypatch.setenv("HF_ENDPOINT", server.address)
        monkeypatch.setenv("HF_TOKEN", "secret")
        storage.prefix = "/datasets/CARD-Data/card-germany/resolve/v1.0.0/"
        server.elsewhere = storage.address
        release = Release("hf://datasets/CARD-Data/card-germany@v1.0.0")
        assert release.read("de_test", 0, "labels") == Release(tree).read("de_test", 0, "labels")
        # The token is for the Hub, not for the storage that it sends the reader to.
        assert set(server.tokens) == {"Bearer secret"}
        assert set(storage.tokens) == {None}


def test_an_address_that_is_no_dataset_is_refused() -> None:
    with pytest.raises(CardError, match=r"not a dataset on the Hub \(found hf://models/x"):
        Release("hf://models/x")


@pytest.mark.parametrize("faults", [[500, 503], [0], [429]])
def test_what_may_pass_is_tried_again(tree: Path, faults: list[int], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader_files, "PAUSE_S", 0.0)
    with served(tree) as server:
        release = Release(server.address)
        server.faults += faults
        assert release.read("de_test", 1, "camera_left") == Release(tree).read("de_test", 1, "camera_left")


def test_a_server_that_stays_broken_or_refuses_is_named(tree: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader_files, "PAUSE_S", 0.0)
    with served(tree) as server:
        release = Release(server.address)
        server.faults += [500] * reader_files.TRIES
        with pytest.raises(CardError, match=r"cannot read from the server \(found HTTP Error 500"):
            release.read("de_test", 1, "camera_left")
        server.faults += [403]
        with pytest.raises(CardError, match=r"the server refuses \(found 403"):
            release.read("de_test", 1, "camera_left")
        server.ranges = False
        with pytest.raises(CardError, match="does not serve ranges"):
            release.read("de_test", 1, "camera_left")
    with served(tree / "data") as server, pytest.raises(CardError, match="file is missing"):
        Release(server.address)


def test_a_frame_gives_each_modality_and_map(tree: Path) -> None:
    frame = next(Release(tree).iterate("train"))
    assert (frame.sequence, frame.number) == ("de_test", 0)
    assert frame.image().shape == frame.image("camera_right").shape == (24, 32, 3)
    assert frame.boxes() is not None
    assert len(frame.burst("lidar_rear").points) == 8
    depth, height = frame.depth(), frame.height()
    release = Release(tree)
    camera = CameraModel.from_json(release.calibration("de_test")["cameras"]["camera_left"])
    np.testing.assert_array_equal(depth, rasterize(frame.points(), camera))
    np.testing.assert_array_equal(np.isnan(height), np.isnan(depth))
    # The road plane of the test drive lies in the rig's origin, so a height is the point's z in rig, apart
    # from the half pixel between the point and the ray of its pixel.
    points = frame.points()
    up = apply(frame.transform("rig_from_camera_left"), points)[:, 2]
    columns, rows = np.rint(camera.project(points)).astype(int).T
    assert len(points) == 5
    np.testing.assert_allclose(height[rows, columns], up, atol=0.6 * points[:, 2].max() / camera.fx)


def test_transforms_have_the_names_of_the_conventions(tree: Path) -> None:
    release = Release(tree)
    frame = release.transform("world_from_camera_left", "de_test", 4)
    rig = release.transform("world_from_rig", "de_test", 4)
    np.testing.assert_allclose(frame, rig @ release.transform("rig_from_camera_left", "de_test"))
    np.testing.assert_allclose(rig[:3, 3], [0, 6.0, 0])
    there = release.transform("lidar_rear_from_wheel_fl_contact", "de_test")
    back = release.transform("wheel_fl_contact_from_lidar_rear", "de_test")
    np.testing.assert_allclose(there @ back, np.eye(4), atol=1e-12)
    for name, number in (
        ("world_from_rig", None),
        ("world_from_rig", 99),
        ("rig_camera_left", 1),
        ("a_from_rig", 1),
    ):
        with pytest.raises(CardError, match="unknown transform"):
            release.transform(name, "de_test", number)


def test_the_stereo_pair_comes_from_the_calibration(tree: Path) -> None:
    rig = Release(tree).rig("de_test")
    centres = [rig.transform(f"rig_from_camera_{side}", {})[:3, 3] for side in ("left", "right")]
    assert rig.stereo.baseline_m == pytest.approx(np.linalg.norm(centres[1] - centres[0]))
    assert rig.camera("camera_right_undistorted").distortion == (0, 0, 0, 0, 0)
    with pytest.raises(CardError, match="unknown camera"):
        rig.camera("camera_rear")


BLOCKED = """
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}")
BLOCKED = set(sys.argv[2].split(","))
sys.meta_path.insert(0, Blocker())
from card.cli import main
from card.packaging.reader import Release
release = Release(sys.argv[1])
frame = next(release.iterate("train"))
frame.image(), frame.points(), frame.depth(), frame.height()
frame.burst(), frame.boxes(), frame.transform("world_from_rig")
release.rig(frame.sequence).stereo.Q
assert main(["verify", sys.argv[1]]) == 0
assert main(["extract", sys.argv[1], sys.argv[3]]) == 0
"""


def test_the_reader_needs_the_base_dependencies_only(tree: Path, tmp_path: Path) -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    names = {"cv2", "skimage", "huggingface_hub", "sklearn", "small_gicp", "libusb_package"}
    names |= {line.split(">")[0].strip().replace("-", "_") for extra in extras.values() for line in extra}
    done = subprocess.run(
        [sys.executable, "-c", BLOCKED, tree, ",".join(sorted(names)), tmp_path],
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_extracting_writes_the_chosen_members_and_goes_on_where_it_stopped(
    tree: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["extract", str(tree), str(tmp_path), "--frame", "3", "--modality", "camera_left"]
    assert main([*command, "--modality", "lidar_rear"]) == 0
    assert "2 files" in capsys.readouterr().out
    image = tmp_path / "de_test" / "000003.camera_left.jpg"
    assert image.read_bytes() == Release(tree).read("de_test", 3, "camera_left")
    assert (tmp_path / "de_test" / "000003.lidar_rear.laz").is_file()
    before = image.stat().st_mtime_ns
    (tmp_path / "de_test" / "000003.lidar_rear.laz").write_bytes(b"half")
    assert main(["extract", str(tree), str(tmp_path), "--split", "train"]) == 0
    assert image.stat().st_mtime_ns == before
    assert len(list((tmp_path / "de_test").iterdir())) == 2 * 6
    assert (tmp_path / "de_test" / "000003.lidar_rear.laz").read_bytes()[:4] == b"LASF"
    assert main(["extract", str(tree), str(tmp_path), "--sequence", "de_gone"]) == 1
    assert "nothing of the release is chosen" in capsys.readouterr().err


def test_all_of_a_release_can_be_extracted_over_the_web(tree: Path, tmp_path: Path) -> None:
    with served(tree) as server:
        assert main(["extract", server.address, str(tmp_path)]) == 0
    assert len(list((tmp_path / "de_test").iterdir())) == 4 + 5 * FRAMES


def test_the_mask_of_an_image_is_what_was_filled(tree: Path) -> None:
    release = Release(tree)
    mask = release.redaction_mask("de_test", 2)
    model = release.calibration("de_test")["cameras"]["camera_left"]
    assert mask.shape == (model["height"], model["width"])
    assert mask[:8, 8:16].all()
    assert mask.sum() == 64
    assert not release.redaction_mask("de_test", 2, "camera_right").any()
