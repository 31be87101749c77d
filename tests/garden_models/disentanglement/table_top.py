"""A rendered table with a box and a ball that touch, seen from twelve sides, with truth."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import trimesh

from garden_models.geometry.camera import backproject_depth
from garden_models.geometry.rigid import transform_points
from garden_models.rendering.rasterise import interpolate, rasterise_mesh
from garden_models.rendering.turntable import look_at
from garden_models.scene import (
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PlacementHypothesis,
    PointCloud,
    Reconstruction,
    Scale,
    SupportSurface,
    Target,
    View,
)

SIZE = (160, 120)
K = np.array([[150.0, 0, 80], [0, 150.0, 60], [0, 0, 1]])
TABLE_Y, HALF = 0.0, 0.6
SPACING = 0.008
BOX, BALL, TABLE, GHOST = 0, 1, 2, 3
OUTLINE = HALF * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
SUPPORT = SupportSurface("table_1", "table", TABLE_Y, OUTLINE, 1.44, 10_000)


@dataclass(frozen=True)
class TableTop:
    """The reconstruction, what each of its points is, and the box's mesh, masks, placement."""

    reconstruction: Reconstruction
    gravity_view: GravityView
    truth: np.ndarray
    mesh: ObjectMesh
    placement: Placement
    masks: ObjectMasks


def stripes(x):
    """Colour of the table: stripes of 8 cm along z."""
    light = (np.floor(x / 0.08) % 2 == 0)[..., None]
    return np.where(light, [200.0, 160, 110], [120.0, 70, 40])


def solids():
    """Box and ball standing on the table and touching, and the table's top, in GV."""
    box = trimesh.creation.box([0.16, 0.2, 0.12]).subdivide().subdivide().subdivide()
    box.apply_translation([0, -0.1, 0])
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.06)
    ball.apply_translation([0.14, -0.06, 0])
    steps = np.linspace(-HALF, HALF, 61)
    x, z = np.meshgrid(steps, steps)
    top = np.stack([x.ravel(), np.full(x.size, TABLE_Y), z.ravel()], axis=1)
    i = np.arange(61 * 60).reshape(60, 61)[:, :60].ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + 62], 1), np.stack([i, i + 62, i + 61], 1)])
    return box, ball, trimesh.Trimesh(top, faces, process=False)


@cache
def table_top(noise=0.002):
    """Render, fuse noisy depth to points, and add ghosts around the box."""
    rng = np.random.default_rng(0)
    parts = solids()
    vertices = np.concatenate([part.vertices for part in parts])
    offset = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + o for part, o in zip(parts, offset, strict=False)])
    owner = np.repeat([BOX, BALL, TABLE], [len(part.faces) for part in parts])
    colour = np.concatenate(
        [
            np.tile([220.0, 30, 30], (len(parts[0].vertices), 1)),
            np.tile([30.0, 200, 30], (len(parts[1].vertices), 1)),
            stripes(parts[2].vertices[:, 0]),
        ]
    )
    views, masks, points, labels, rgbs = [], [], [], [], []
    for i in range(12):
        angle = 2 * np.pi * i / 12
        eye = np.array([0.9 * np.sin(angle), -0.35 - 0.3 * (i % 2), -0.9 * np.cos(angle)])
        camera = look_at(eye, np.array([0.04, -0.06, 0.0]))
        raster = rasterise_mesh(transform_points(camera, vertices), faces, K, SIZE)
        rgb = interpolate(raster, faces, colour)
        depth = raster.depth * (1 + rng.normal(0, noise, raster.depth.shape))
        seen = raster.face_index >= 0
        what = np.where(seen, owner[raster.face_index], -1)
        views.append(
            View(f"{i:02d}.jpg", rgb.astype(np.uint8), depth, np.ones_like(depth), K, camera, SIZE)
        )
        masks.append(what == BOX)
        world = backproject_depth(depth, K, camera)
        points.append(world[seen])
        labels.append(what[seen])
        # Colours of the table are taken exactly, so that a fill can be compared with them.
        exact = np.where((what == TABLE)[..., None], stripes(world[..., 0]), rgb)
        rgbs.append(exact[seen])
    xyz, truth, rgb = np.concatenate(points), np.concatenate(labels), np.concatenate(rgbs)
    _, first = np.unique(np.floor(xyz / SPACING).astype(int), axis=0, return_index=True)
    xyz, truth, rgb = xyz[first], truth[first], rgb[first]
    ghosts = rng.uniform([-0.1, -0.215, -0.08], [0.08, -0.205, 0.08], (60, 3))
    xyz = np.concatenate([xyz, ghosts])
    truth = np.concatenate([truth, np.full(60, GHOST)])
    rgb = np.concatenate([rgb, np.full((60, 3), 128.0)])
    n = len(xyz)
    up = np.tile([0.0, -1, 0], (n, 1))
    cloud = PointCloud(xyz, rgb.astype(np.uint8), up, np.full(n, SPACING), np.ones(n))
    reconstruction = Reconstruction(
        tuple(views), cloud, np.zeros((0, 3)), (), Scale("known_cameras"), "known"
    )
    target = Target("box", "00.jpg", (40, 20, 100, 90))
    return TableTop(
        reconstruction,
        GravityView(np.eye(4), "00.jpg", np.array([0, 1.0, 0]), 0.1, ()),
        truth,
        _mesh(parts[0]),
        Placement(
            "box", (PlacementHypothesis("seen", np.eye(3), np.zeros(3), 1.0, {}),), 0, "seen"
        ),
        ObjectMasks(
            target,
            tuple(view.photo for view in views),
            tuple(masks),
            np.zeros(12),
            cloud.subset(truth == BOX),
            SUPPORT,
        ),
    )


def _mesh(solid):
    count = len(solid.vertices)
    return ObjectMesh(
        "box",
        solid.vertices,
        solid.faces,
        np.tile(np.uint8([220, 30, 30]), (count, 1)),
        np.ones(count, bool),
        np.eye(4),
        True,
    )
