"""MuJoCo opens scene.xml from its folder and shows every side in the colours of the mesh."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from flows.package.mujoco_files import mujoco_files
from garden_models.geometry.rigid import rigid
from garden_models.geometry.rotation import yaw_gv
from garden_models.physics.mjcf import ZUP_FROM_GV
from garden_models.scene import Body, ConvexPiece, Scale, SimScene, SupportSurface
from tests.mujoco_picture import drawing, picture

SIZE = 200
HALF = 0.1
GV_FROM_BODY = rigid(yaw_gv(0.4), np.array([0.3, 0.2, 1.5]))

NORMALS = np.concatenate([np.eye(3), -np.eye(3)])
COLOURS = np.array(
    [[230, 40, 30], [40, 200, 60], [50, 70, 240], [240, 220, 50], [200, 60, 220], [60, 220, 230]]
)
"""One for each side."""


def side_corners(normal):
    """The corners of one side of the cube, counter-clockwise seen from outside, body frame."""
    across = np.roll(normal, 1)
    along = np.cross(normal, across)
    signs = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    return np.array([HALF * (normal + a * across + b * along) for a, b in signs])


def cube(side_rgb):
    """A cube whose sides do not share vertices; ``side_rgb`` (6, 4, 3), a colour per corner."""
    vertices = np.concatenate([side_corners(normal) for normal in NORMALS])
    halves = np.array([[0, 1, 2], [0, 2, 3]])
    faces = np.concatenate([halves + 4 * side for side in range(6)])
    hull = ConvexPiece(vertices, faces)
    inertia = np.eye(3) * HALF**2 / 1.5
    return Body(
        "cube", vertices, faces, side_rgb.reshape(-1, 3).astype(np.uint8), (hull,), 1.0,
        np.zeros(3), inertia, 0.5, GV_FROM_BODY, 0.0, "floor",
    )  # fmt: skip


def opened(body, folder):
    """The model of a scene with one body, loaded from files in ``folder``."""
    outline = np.array([[-1.0, 0], [1, 0], [1, 3], [-1, 3]])
    floor = SupportSurface("floor", "floor", 1.0, outline, 6.0, 1000)
    scene = SimScene((body,), (floor,), Scale("known_cameras"))
    for name, content in mujoco_files(scene).items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))


def zup(point_body):
    return ZUP_FROM_GV @ (GV_FROM_BODY[:3, :3] @ point_body + GV_FROM_BODY[:3, 3])


def seen_from_outside(model, normal, distance=0.6):
    """Look straight at one side of the cube, its middle in the middle of the picture."""
    forward = -ZUP_FROM_GV @ GV_FROM_BODY[:3, :3] @ normal
    return picture(model, zup(HALF * normal), forward, distance, SIZE)


def test_every_side_has_its_colour(tmp_path):
    model = opened(cube(np.repeat(COLOURS[:, None], 4, axis=1)), tmp_path)
    with drawing(SIZE):
        for normal, colour in zip(NORMALS, COLOURS, strict=True):
            seen = seen_from_outside(model, normal)
            middle = seen[SIZE // 2 - 20 : SIZE // 2 + 20, SIZE // 2 - 20 : SIZE // 2 + 20]
            np.testing.assert_allclose(middle, np.broadcast_to(colour, middle.shape), atol=2)


def test_a_far_side_has_its_colour_too(tmp_path):
    # Far enough that a viewer uses a coarse level of the mipmap.
    model = opened(cube(np.repeat(COLOURS[:, None], 4, axis=1)), tmp_path)
    with drawing(SIZE):
        for normal, colour in zip(NORMALS, COLOURS, strict=True):
            seen = seen_from_outside(model, normal, distance=10.0)
            np.testing.assert_allclose(seen[SIZE // 2, SIZE // 2], colour, atol=40)


@pytest.mark.parametrize("side", range(6))
def test_corners_are_where_they_belong_and_blend_between(tmp_path, side):
    corners = np.array([[200, 60, 60], [60, 200, 60], [60, 60, 200], [130, 130, 130]])
    model = opened(cube(np.tile(corners, (6, 1, 1))), tmp_path)
    normal = NORMALS[side]
    with drawing(SIZE):
        for i, corner in enumerate(side_corners(normal)):
            # A tenth of the way from the corner to the middle of its own face.
            face = (0, 1, 2) if i < 3 else (0, 2, 3)
            weight = np.full(4, 0.0)
            weight[list(face)] = 0.1 / 3
            weight[i] += 0.9
            place = weight @ side_corners(normal)
            assert np.allclose(place, corner, atol=HALF / 5)
            forward = -ZUP_FROM_GV @ GV_FROM_BODY[:3, :3] @ normal
            seen = picture(model, zup(place), forward, 0.4, SIZE)[SIZE // 2, SIZE // 2]
            np.testing.assert_allclose(seen, weight @ corners, atol=3)


def test_files_are_named_relative_to_the_scene(tmp_path):
    body = cube(np.repeat(COLOURS[:, None], 4, axis=1))
    opened(body, tmp_path / "first")
    (tmp_path / "first").rename(tmp_path / "moved")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "moved" / "scene.xml"))
    assert model.ntex == 1
    names = {str(p.relative_to(tmp_path / "moved")) for p in (tmp_path / "moved").rglob("*.*")}
    assert {"scene.xml", "assets/cube_visual.obj", "assets/cube_visual.png"} <= names
