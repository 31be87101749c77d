"""The rasteriser against ray casting by an independent library, and its laws."""

from __future__ import annotations

import time

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.rendering.rasterise import interpolate, rasterise_mesh

SIZE = (168, 112)
K = np.array([[150.0, 0, 84.0], [0, 150.0, 56.0], [0, 0, 1]])


def ray_cast(vertices, faces, K, size):
    """First-hit depth and face by embree."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    rays = pixel_rays(pixel_grid(size[1], size[0]), K).reshape(-1, 3)
    intersector = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
    points, ray, face = intersector.intersects_location(
        np.zeros_like(rays), rays, multiple_hits=False
    )
    depth = np.zeros(len(rays))
    index = np.full(len(rays), -1)
    depth[ray], index[ray] = points[:, 2], face
    return depth.reshape(size[::-1]), index.reshape(size[::-1])


def bumpy_sphere(seed=0, subdivisions=4):
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.5)
    noise = np.random.default_rng(seed).normal(0, 0.02, len(sphere.vertices))
    return sphere.vertices * (1 + noise)[:, None] + [0.1, -0.05, 2.0], sphere.faces


def test_equals_ray_casting():
    vertices, faces = bumpy_sphere()
    raster = rasterise_mesh(vertices, faces, K, SIZE)
    depth, index = ray_cast(vertices, faces, K, SIZE)
    both = (raster.depth > 0) & (depth > 0)
    assert ((raster.depth > 0) != (depth > 0)).sum() <= 3  # rays through an exact edge
    assert np.abs(raster.depth - depth)[both].max() < 1e-4
    assert (raster.face_index == index)[both].mean() > 0.999


def test_inside_the_mesh_the_near_plane_cuts():
    """A camera inside a box sees its walls although corners lie behind it."""
    box = trimesh.creation.box([2.0, 2.0, 2.0])
    vertices = box.vertices + np.array([0.2, 0.1, 0.3])
    raster = rasterise_mesh(vertices, box.faces, K, SIZE)
    depth, _ = ray_cast(vertices, box.faces, K, SIZE)
    assert (raster.depth > 0).all()
    np.testing.assert_allclose(raster.depth, depth, rtol=1e-4)


def test_near_plane_hides_what_is_closer():
    vertices = np.array([[-1.0, -1.0, 0.5], [1.0, -1.0, 0.5], [0.0, 1.0, 0.5]])
    faces = np.array([[0, 1, 2]])
    assert (rasterise_mesh(vertices, faces, K, SIZE, near=0.6).face_index == -1).all()
    assert (rasterise_mesh(vertices, faces, K, SIZE, near=0.4).face_index == 0).any()
    assert (rasterise_mesh(-vertices, faces, K, SIZE).face_index == -1).all()


def test_no_hole_between_faces_of_a_plane():
    """A triangulated plane through exact pixel centres has no gap and depth on the plane."""
    steps = np.linspace(-3, 3, 61)
    x, y = np.meshgrid(steps, steps)
    vertices = np.stack([x.ravel(), y.ravel(), 2.0 + 0.3 * x.ravel()], axis=1)
    i = np.arange(60 * 61).reshape(60, 61)[:, :60].ravel()
    faces = np.concatenate(
        [np.stack([i, i + 1, i + 62], axis=1), np.stack([i, i + 62, i + 61], axis=1)]
    )
    raster = rasterise_mesh(vertices, faces, K, SIZE)
    assert (raster.face_index >= 0).all()
    rays = pixel_rays(pixel_grid(SIZE[1], SIZE[0]), K)
    np.testing.assert_allclose(raster.depth, 2.0 / (1 - 0.3 * rays[..., 0]), rtol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000))
def test_interpolation_is_perspective_correct(seed):
    """Interpolating camera-frame positions gives back the ray at the depth."""
    rng = np.random.default_rng(seed)
    vertices = rng.uniform([-2, -2, -1], [2, 2, 5], (30, 3))
    faces = np.array([rng.choice(30, 3, replace=False) for _ in range(20)])
    raster = rasterise_mesh(vertices, faces, K, SIZE)
    seen = raster.face_index >= 0
    position = interpolate(raster, faces, vertices)
    rays = pixel_rays(pixel_grid(SIZE[1], SIZE[0]), K)
    np.testing.assert_allclose(
        position[seen], (rays * raster.depth[..., None])[seen], rtol=1e-3, atol=1e-3
    )
    np.testing.assert_allclose(raster.barycentric[seen].sum(axis=1), 1, atol=1e-5)
    assert (raster.depth[~seen] == 0).all()


def test_empty_degenerate_and_wrong():
    empty = rasterise_mesh(np.zeros((0, 3)), np.zeros((0, 3), int), K, SIZE)
    assert (empty.face_index == -1).all()
    flat = np.array([[0.0, 0, 1], [0, 0, 2], [0, 0, 3]])
    assert (rasterise_mesh(flat, np.array([[0, 1, 2]]), K, SIZE).face_index == -1).all()
    with pytest.raises(ValueError, match="has 3 vertices"):
        rasterise_mesh(flat, np.array([[0, 1, 3]]), K, SIZE)


def test_twenty_thousand_faces_take_a_fraction_of_a_second():
    vertices, faces = bumpy_sphere(subdivisions=5)
    size, big = (504, 336), np.diag([3.0, 3.0, 1.0]) @ K
    assert len(faces) > 20_000
    start = time.process_time()
    rasterise_mesh(vertices, faces, big, size)
    assert time.process_time() - start < 1.0  # about 0.15 s; the slack is for a busy machine
