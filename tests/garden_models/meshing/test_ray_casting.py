from __future__ import annotations

import numpy as np
import trimesh

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.meshing.ray_casting import RayCaster
from garden_models.rendering.rasterise import rasterise_mesh


def test_rays_through_pixels_agree_with_the_rasteriser() -> None:
    mesh = trimesh.creation.torus(1.0, 0.4)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.6, [1, 0.3, 0]))
    mesh.apply_translation([0.2, -0.1, 4.0])
    K = np.array([[70.0, 0, 40], [0, 70.0, 30], [0, 0, 1]])
    raster = rasterise_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), K, (80, 60))
    rays = pixel_rays(pixel_grid(60, 80), K).reshape(-1, 3)
    hits = RayCaster(np.asarray(mesh.vertices), np.asarray(mesh.faces)).cast(
        np.zeros_like(rays), rays
    )
    both = (raster.depth.ravel() > 0) & (hits.face >= 0)
    assert ((raster.depth.ravel() > 0) == (hits.face >= 0)).mean() > 0.999
    np.testing.assert_allclose(raster.depth.ravel()[both], hits.distance[both], rtol=1e-4)


def test_barycentric_weights_rebuild_the_hit() -> None:
    mesh = trimesh.creation.icosphere(2)
    rng = np.random.default_rng(0)
    origins = np.tile([0.0, 0.0, -5.0], (200, 1))
    directions = np.column_stack([0.15 * rng.normal(size=(200, 2)), np.ones(200)])
    caster = RayCaster(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    hits = caster.cast(origins, directions)
    hit = hits.face >= 0
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.faces)[hits.face[hit]]]
    rebuilt = (corners * hits.barycentric[hit][..., None]).sum(axis=1)
    expected = origins[hit] + directions[hit] * hits.distance[hit, None]
    np.testing.assert_allclose(rebuilt, expected, atol=1e-5)
    np.testing.assert_array_equal(caster.blocked(origins, directions), hit)
    assert np.isinf(hits.distance[~hit]).all()
