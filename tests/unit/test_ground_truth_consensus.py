import hashlib

import numpy as np
import onnx
import pytest
from ground_truth_scene import calibration
from onnx import TensorProto, helper

from card.artifacts import default_settings, load_schema, write_table
from card.errors import CardError
from card.geometry import CameraModel
from card.ground_truth.consensus import Consensus, depth_maps, fit_scale
from card.ground_truth.monocular import OnnxDepth

SETTINGS = default_settings("ground_truth")["consensus"]
IMAGE = CameraModel.from_json(calibration()["cameras"]["camera_left"])
UNDISTORTED = CameraModel.from_json(calibration()["camera_left_undistorted"])
SHAPE = UNDISTORTED.height, UNDISTORTED.width


def plane_points(z: float, step: int = 4) -> np.ndarray:
    """Points on a plane across the view, one every `step` pixels."""
    u, v = np.meshgrid(np.arange(4, SHAPE[1] - 4, step), np.arange(4, SHAPE[0] - 4, step))
    return UNDISTORTED.rays(np.stack([u.ravel(), v.ravel()], axis=1).astype(float)) * z


def against(depth: np.ndarray, points: np.ndarray, keyframe: np.ndarray, **changed) -> np.ndarray:
    consensus = Consensus(lambda frame, t_ns: depth, UNDISTORTED, SETTINGS | changed)
    return consensus.consistent(3, 5, points, keyframe)


def test_the_scale_is_that_of_least_squares_without_extreme_depths():
    rng = np.random.default_rng(0)
    depth = rng.uniform(1, 3, SHAPE).astype(np.float32)
    lidar = np.full(SHAPE, np.nan)
    seen = rng.random(SHAPE) < 0.1
    lidar[seen] = 7 * depth[seen] + rng.normal(0, 0.01, seen.sum())
    z, d = lidar[seen], depth[seen].astype(float)
    inside = (z >= np.percentile(z, 5)) & (z <= np.percentile(z, 95))
    wanted = np.linalg.lstsq(d[inside, None], z[inside], rcond=None)[0][0]
    assert fit_scale(lidar, depth, (5, 95)) == pytest.approx(wanted, rel=1e-9)
    # A few returns of a car that the model does not see are extreme depths.
    lidar[3, :20] = 500.0
    assert fit_scale(lidar, depth, (5, 95)) == pytest.approx(7, rel=0.01)


def test_a_mover_s_points_go_and_what_cannot_be_tested_stays():
    depth = np.full(SHAPE, 2.0, dtype=np.float32)
    depth[:40] = np.nan
    depth[40:50] = 0
    keyframe = plane_points(10.0)
    mover, wall, far = plane_points(7.0), plane_points(10.9), plane_points(60.0)
    points = np.concatenate([mover, wall, far])
    keep = against(depth, points, keyframe)
    rows = UNDISTORTED.project(points)[:, 1]
    is_mover = np.arange(len(points)) < len(mover)
    assert np.array_equal(keep, ~(is_mover & (rows >= 49.5)))
    assert against(depth, points, keyframe, tau_rel=0.5).all()
    assert not against(depth, wall, keyframe, tau_rel=0.05)[-1]
    # Without a fit nothing is rejected; neither is a point beside the image.
    assert against(depth, points, keyframe[:5]).all()
    assert against(depth, np.array([[50.0, 0, 1.0]]), keyframe).all()


def model(path, output: str = "mean"):
    """Depth = mean of the channels, by hand."""
    node = helper.make_node("ReduceMean", ["x"], ["y"], axes=[1] if output == "mean" else [1, 2], keepdims=0)
    graph = helper.make_graph(
        [node],
        "depth",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, [1, 3, None, None])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, None)],
    )
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)
    onnx.save(made, path)
    return {"model": str(path), "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}


@pytest.fixture
def anonymized(tmp_path):
    import cv2

    folder = tmp_path / "anonymized"
    (folder / "camera_left").mkdir(parents=True)
    brightness = np.tile(np.linspace(40, 200, IMAGE.width), (IMAGE.height, 1)).astype(np.uint8)
    cv2.imwrite(str(folder / "camera_left" / "77.png"), np.dstack([brightness] * 3))
    blank = {"string": "", "int32": 1, "int64": 1, "float64": 0.0, "float32": 0.0, "bool": False}
    row = {name: blank[column["type"]] for name, column in load_schema("images")["columns"].items()}
    row |= {"camera": "camera_left", "t_ns": 77, "file": "camera_left/77.png"}
    for name, column in load_schema("images")["columns"].items():
        if "enum" in column and row[name] not in column["enum"]:
            row[name] = column["enum"][0]
    write_table(folder / "images.parquet", {name: [value] for name, value in row.items()}, "images")
    return folder


def plain(tmp_path, **changed):
    return SETTINGS | {"mean": [0, 0, 0], "std": [1, 1, 1], **model(tmp_path / "m.onnx")} | changed


def test_a_model_sees_the_undistorted_anonymized_image(anonymized, tmp_path):
    depth = OnnxDepth(anonymized, IMAGE, UNDISTORTED, plain(tmp_path, input_width=100, input_height=80))(
        0, 77
    )
    assert depth.shape == SHAPE
    assert depth.dtype == np.float32
    pixels = np.array([[60.0, 80], [100, 40], [150, 120]])
    # Brightness grows with the column of the original image.
    columns = IMAGE.project(UNDISTORTED.rays(pixels))[:, 0]
    wanted = (40 + columns * 160 / (IMAGE.width - 1)) / 255
    found = depth[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    assert found == pytest.approx(wanted, abs=0.01)
    whole = {"output": "inverse_depth", "input_width": 200, "input_height": 160}
    inverse = OnnxDepth(anonymized, IMAGE, UNDISTORTED, plain(tmp_path, **whole))(0, 77)
    assert inverse[80, 60] == pytest.approx(1 / wanted[0], rel=0.03)


def test_what_is_wrong_with_a_model_is_said(anonymized, tmp_path):
    def opened(**changed):
        return OnnxDepth(anonymized, IMAGE, UNDISTORTED, plain(tmp_path) | changed)

    with pytest.raises(CardError, match="depth model is missing"):
        opened(model=str(tmp_path / "none.onnx"))
    with pytest.raises(CardError, match="depth model is another file"):
        opened(sha256="0" * 64)
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"no model")
    with pytest.raises(CardError, match="unreadable depth model"):
        opened(model=str(broken), sha256=hashlib.sha256(b"no model").hexdigest())
    with pytest.raises(CardError, match="no anonymized image"):
        opened()(0, 78)
    with pytest.raises(CardError, match="depth model gives no map"):
        opened(**model(tmp_path / "flat.onnx", "flat"))(0, 77)


def test_depth_maps_are_read_or_refused(tmp_path):
    read = depth_maps(tmp_path, UNDISTORTED)
    np.save(tmp_path / "000004.npy", np.ones(SHAPE, np.float32))
    assert read(4, 0).shape == SHAPE
    with pytest.raises(CardError, match="depth map is missing"):
        read(5, 0)
    np.save(tmp_path / "000005.npy", np.ones((3, 3), np.float32))
    with pytest.raises(CardError, match="does not fit the undistorted image"):
        read(5, 0)
    (tmp_path / "000006.npy").write_bytes(b"x")
    with pytest.raises(CardError, match="unreadable depth map"):
        read(6, 0)
