"""Meshes and points in one picture, and the choice of views."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from garden_models.geometry.rigid import rigid
from garden_models.rendering.config import NEUTRAL, RenderViews
from garden_models.rendering.hybrid import BACKGROUND_ID, render_scene
from garden_models.rendering.turntable import Turntable, look_at, turn_mesh, view_cloud
from garden_models.rendering.views import chosen_views, render_views
from garden_models.scene import (
    Background,
    BadInput,
    Body,
    BodyMotion,
    GravityView,
    Reconstruction,
    Scale,
    SimScene,
    Trajectory,
    View,
)
from tests.garden_models.rendering.test_splat import SIZE, K, cloud, wall


def ball(name, radius=0.2, rgb=(250, 20, 20)):
    solid = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    colour = np.tile(np.uint8(rgb), (len(solid.vertices), 1))
    return Body(name, solid.vertices, solid.faces, colour, (), 1.0, np.zeros(3), np.eye(3), 0.5,
                np.eye(4), 0.0, "floor")  # fmt: skip


def at(x, y, z):
    return rigid(np.eye(3), np.array([x, y, z]))


BACK = wall(3.0, 0.03, (20, 20, 250), half=4)


def test_depth_order_of_meshes_and_points():
    bodies = (ball("front"), ball("back", rgb=(20, 250, 20)), ball("hidden"))
    poses = [at(0, 0, 1.5), at(0.15, 0, 2.0), at(0, 0, 4.0)]
    picture = render_scene(bodies, poses, BACK, np.eye(4), K, SIZE)
    assert picture.object_ids[60, 80] == 0
    assert picture.object_ids[60, 101] == 1
    assert (picture.object_ids != 2).all()
    assert picture.object_ids[5, 5] == BACKGROUND_ID
    assert (picture.rgb[60, 80] == [250, 20, 20]).all()
    assert (picture.rgb[5, 5] == [20, 20, 250]).all()
    assert picture.depth[60, 80] == pytest.approx(1.3, abs=0.01)
    assert picture.depth[5, 5] == pytest.approx(3.0, abs=1e-3)


def test_points_before_a_mesh_hide_it():
    picture = render_scene((ball("a"),), [at(0, 0, 4.0)], BACK, np.eye(4), K, SIZE)
    assert (picture.object_ids == BACKGROUND_ID).all()


def test_where_nothing_is_seen_it_is_neutral():
    nothing = cloud(np.zeros((0, 3)), 9, 0.1)
    picture = render_scene((), (), nothing, np.eye(4), K, SIZE)
    assert (picture.rgb == NEUTRAL).all()
    assert (picture.depth == 0).all()


def test_camera_moves_like_the_scene_moves_back():
    camera = at(0.1, -0.05, 0.2)
    moved = render_scene((ball("a"),), [at(0, 0, 1.5)], BACK, camera, K, SIZE)
    back = BACK.xyz + camera[:3, 3]
    still = render_scene(
        (ball("a"),), [camera @ at(0, 0, 1.5)], cloud(back, BACK.rgb, 0.03), np.eye(4), K, SIZE
    )
    assert (moved.object_ids == still.object_ids).mean() > 0.999


def view(name):
    rgb = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    return View(name, rgb, np.ones(SIZE[::-1]), np.ones(SIZE[::-1]), K, np.eye(4)[:3], SIZE)


def test_views_are_spread_and_hold_the_targets():
    views = [view(f"{i:02d}.jpg") for i in range(20)]
    chosen = [v.photo for v in chosen_views(views, ["07.jpg"], 4)]
    assert "07.jpg" in chosen
    assert len(chosen) == 4
    index = [int(name[:2]) for name in chosen]
    assert index == sorted(index)
    assert max(np.diff([0, *index, 19])) <= 8
    assert len(chosen_views(views[:2], [], 8)) == 2


def test_render_views_shows_the_motion():
    scene = SimScene((ball("a"),), (), Scale("known_cameras"))
    scene = SimScene(
        (type(scene.bodies[0])(**{**vars(scene.bodies[0]), "gv_from_body": at(0, 0, 1.5)}),),
        (),
        scene.scale,
    )
    positions = np.array([[[0, 0, 1.5]], [[0.4, 0, 1.5]]])
    quaternions = np.tile([1.0, 0, 0, 0], (2, 1, 1))
    motion = BodyMotion("a", 0, 0.4, 0, True)
    trajectory = Trajectory(np.array([0, 1.0]), positions, quaternions, (motion,))
    reconstruction = Reconstruction((view("a.jpg"), view("b.jpg")), BACK, np.zeros((0, 3)), (),
                                    scene.scale)  # fmt: skip
    gravity = GravityView(np.eye(4), "a.jpg", np.array([0, 1.0, 0]), 0.1, ())
    background = Background(BACK, np.zeros(len(BACK), bool), {})
    renders = render_views(
        scene, trajectory, background, reconstruction, gravity, ["b.jpg"], RenderViews(most_views=1)
    )
    (render,) = renders.renders
    assert render.photo == "b.jpg"
    assert (render.before[60, 80] == [250, 20, 20]).all()
    assert (render.after[60, 80] == [20, 20, 250]).all()
    assert render.object_ids[60, 80 + 37] == 0
    assert (render.background == [20, 20, 250]).all()
    with pytest.raises(BadInput, match="other bodies"):
        render_views(SimScene((), (), scene.scale), trajectory, background, reconstruction, gravity)


def test_turntable_shows_every_side():
    """A ball that is red on one side is red from there and not from the other side."""
    body = ball("a")
    colour = np.where(body.vertices[:, 2:] < 0, np.uint8([[250, 0, 0]]), np.uint8([[0, 0, 250]]))
    pictures = turn_mesh(body.vertices, body.faces, colour, Turntable(sides=4, size=(64, 64)))
    assert len(pictures) == 5
    assert pictures[0][32, 32, 0] > 100 > pictures[0][32, 32, 2]
    assert pictures[2][32, 32, 2] > 100 > pictures[2][32, 32, 0]
    assert (pictures[0][0, 0] == 240).all()
    # From above, the near (red) half is at the bottom of the picture.
    assert pictures[4][40, 32, 0] > 100 > pictures[4][24, 32, 0]


def test_cloud_is_upright():
    pole = np.stack([np.zeros(200), np.linspace(-1, 0, 200), np.zeros(200)], axis=1)
    colour = np.where(pole[:, 1:2] < -0.5, np.uint8([[250, 0, 0]]), np.uint8([[0, 0, 250]]))
    picture = view_cloud(cloud(pole, colour, 0.02)).astype(int)
    red = np.argwhere(picture[..., 0] - picture[..., 2] > 100)[:, 0]
    blue = np.argwhere(picture[..., 2] - picture[..., 0] > 100)[:, 0]
    assert red.max() <= blue.min() + 2
    assert view_cloud(cloud(np.zeros((0, 3)), 9, 0.1)).shape == (480, 640, 3)


def test_look_at_is_a_rigid_upright_camera():
    camera = look_at(np.array([1.0, -2.0, -3.0]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(camera[:, :3] @ camera[:, :3].T, np.eye(3), atol=1e-12)
    assert camera[0, 1] == pytest.approx(0)
    assert camera[1, 1] > 0
