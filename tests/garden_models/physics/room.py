"""A synthetic room: a floor, a table, and meshes of known solids, noisy if asked."""

from __future__ import annotations

import numpy as np
import trimesh

from garden_models.geometry.rotation import yaw_gv
from garden_models.scene import (
    Background,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PlacementHypothesis,
    PointCloud,
    Scale,
    SupportSurface,
    Target,
)

FLOOR_Y, TABLE_Y = 1.2, 0.5
TABLE_OUTLINE = np.array([[-0.5, 1.5], [0.5, 1.5], [0.5, 2.3], [-0.5, 2.3]])
TABLE = SupportSurface("own", "table", TABLE_Y, TABLE_OUTLINE, 0.8, 1000)
SCALE = Scale("known_cameras")
GRAVITY = GravityView(np.eye(4), "photo", np.array([0.0, 1.0, 0.0]), 0.1, ())


def cloud(xyz, spacing=0.015):
    n = len(xyz)
    rgb = np.full((n, 3), 128, np.uint8)
    up = np.tile([[0.0, -1.0, 0.0]], (n, 1))
    return PointCloud(xyz, rgb, up, np.full(n, spacing), np.ones(n))


def level(x, z, y, step, seed):
    rng = np.random.default_rng(seed)
    X, Z = np.meshgrid(np.arange(*x, step), np.arange(*z, step))
    return np.stack([X.ravel(), y + rng.normal(0, 0.002, X.size), Z.ravel()], axis=1)


def room_background():
    floor = level((-1.5, 1.5), (0.5, 3.5), FLOOR_Y, 0.02, 0)
    table = level((-0.5, 0.5), (1.5, 2.3), TABLE_Y, 0.01, 1)
    points = np.concatenate([floor, table])
    return Background(cloud(points), np.zeros(len(points), bool), {})


def upright(name, solid, noise=0.0, seed=0):
    """A trimesh (z-up) as an ObjectMesh whose vertices are off by smooth relative noise."""
    vertices = solid.vertices @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    vertices = vertices - [(low[0] + high[0]) / 2, high[1], (low[2] + high[2]) / 2]
    turned = trimesh.Trimesh(vertices, solid.faces, process=False)
    offset = np.random.default_rng(seed).normal(size=len(vertices))
    for _ in range(3):
        total = np.bincount(turned.edges.ravel(), offset[turned.edges[:, ::-1].ravel()])
        offset = total / np.bincount(turned.edges.ravel())
    offset *= noise * (high - low).max() / offset.std()
    vertices = vertices + turned.vertex_normals * offset[:, None]
    rgb = np.full((len(vertices), 3), 150, np.uint8)
    seen = np.ones(len(vertices), bool)
    return ObjectMesh(name, vertices, np.asarray(solid.faces), rgb, seen, np.eye(4), True)


def box(size=(0.16, 0.1, 0.2)):
    solid = trimesh.creation.box(size)
    for _ in range(4):
        solid = solid.subdivide()
    return solid


def mug():
    outer = trimesh.creation.cylinder(0.045, 0.1, sections=48)
    raised = trimesh.transformations.translation_matrix([0, 0, 0.01])
    inner = trimesh.creation.cylinder(0.038, 0.1, sections=48, transform=raised)
    return trimesh.boolean.difference([outer, inner]).subdivide().subdivide()


def ball(radius=0.06):
    return trimesh.creation.icosphere(subdivisions=4, radius=radius)


def at(name, x, y, z, yaw=0.0, scale=1.0):
    hypothesis = PlacementHypothesis("only", yaw_gv(yaw), np.array([x, y, z]), scale, {})
    return Placement(name, (hypothesis,), 0, "the only one")


def masks_of(name, support):
    return ObjectMasks(
        Target(name, "photo", (0, 0, 1, 1)), (), (), np.zeros(0), cloud(np.zeros((0, 3))), support
    )
