"""Textured rectangles against Open3D's ray casting and OpenCV's homography."""

import cv2
import numpy as np

from card.artifacts.open3d import import_open3d
from card.geometry import CameraModel, apply, inverse, matrix_from_quaternion, transform
from card.simulation.board_scene import board_quads, surroundings
from card.simulation.quads import Quad, QuadView, cast
from card.simulation.rig import nominal_rig


def _corners(quad: Quad) -> np.ndarray:
    w, h = quad.size_m
    return apply(quad.rig_from_quad, [[0, 0, 0], [w, 0, 0], [w, h, 0], [0, h, 0]])


def test_first_hits_are_open3d_s() -> None:
    rng = np.random.default_rng(0)
    board = transform([0.2, 3.0, 0.1], [0.72, -0.68, 0.1, 0.05])
    quads = [*surroundings(rng), *board_quads(board)]
    directions = rng.normal(size=(4000, 3)) * (0.6, 0.2, 0.3) + (0, 1, 0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origin = np.array([0.0, 0.0, 0.14])
    ranges, index, cosine = cast(quads, origin, directions)

    o3d = import_open3d()
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    vertices = np.concatenate([_corners(quad) for quad in quads]).astype(np.float32)
    triangles = [[4 * i, 4 * i + a, 4 * i + b] for i in range(len(quads)) for a, b in ((1, 2), (2, 3))]
    scene.add_triangles(vertices, np.array(triangles, np.uint32))
    rays = np.concatenate([np.broadcast_to(origin, directions.shape), directions], axis=1)
    found = scene.cast_rays(o3d.core.Tensor(rays.astype(np.float32)))
    hit = np.isfinite(found["t_hit"].numpy())
    wanted = np.where(hit, found["primitive_ids"].numpy().astype(np.int64) // 2, -1)
    # A ray along an edge may go either way.
    same = index == wanted
    assert same.mean() > 0.998
    assert set(np.unique(index)) >= {-1, 0, 1, len(quads) - 1}
    assert np.abs(ranges - found["t_hit"].numpy())[same & hit].max() < 1e-3
    normals = found["primitive_normals"].numpy()
    assert np.abs(cosine - np.abs(np.sum(normals * directions, axis=1)))[same & hit].max() < 1e-4


def test_a_drawn_quad_is_opencv_s_warp_of_its_texture() -> None:
    pose = nominal_rig(200, 200).rig_from["camera_left"]
    camera = CameraModel(200, 200, 150.0, 150.0, 99.5, 99.5)
    smooth = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (120, 160, 3)), (0, 0), 4)
    texture = np.clip((smooth - 127) * 4 + 127, 0, 255).astype(np.uint8)
    tilt = np.eye(4)
    tilt[:3, :3] = matrix_from_quaternion([0.95, 0.1, 0.2, 0.1])
    camera_from_quad = transform([-0.8, -0.6, 2.2]) @ tilt
    quad = Quad(pose @ camera_from_quad, (1.6, 1.2), texture, 50)
    drawn = QuadView(camera, pose, samples=1).draw([quad])

    # Texel k covers [k, k + 1] / 100 m, pixel centres are at integers.
    corners = camera.project(apply(inverse(pose), _corners(quad))).astype(np.float32)
    texels = np.array([[-0.5, -0.5], [159.5, -0.5], [159.5, 119.5], [-0.5, 119.5]], np.float32)
    warp = cv2.getPerspectiveTransform(texels, corners)
    expected = cv2.warpPerspective(texture, warp, (200, 200), flags=cv2.INTER_LINEAR)
    inside = cv2.erode(cv2.warpPerspective(np.ones((120, 160), np.uint8), warp, (200, 200)), np.ones((5, 5)))
    assert inside.sum() > 4000
    tone = 255 * drawn ** (1 / 2.2)
    assert np.abs(tone - expected)[inside == 1].max() <= 3
