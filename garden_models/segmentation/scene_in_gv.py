"""Turn a reconstruction to Gravity-View."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.scene import GravityView, PointCloud, Reconstruction


@dataclass(frozen=True)
class SceneInGV:
    """A reconstruction, its fused points in GV, and each view's camera_from_gv."""

    reconstruction: Reconstruction
    cloud: PointCloud
    cameras: tuple[Float[np.ndarray, "4 4"], ...]


def scene_in_gv(reconstruction: Reconstruction, gravity_view: GravityView) -> SceneInGV:
    """Turn points, normals and cameras to Gravity-View."""
    gv_from_world = gravity_view.gv_from_world
    points = reconstruction.points_world
    cloud = PointCloud(
        transform_points(gv_from_world, points.xyz),
        points.rgb,
        points.normal @ gv_from_world[:3, :3].T,
        points.spacing,
        points.confidence,
    )
    world_from_gv = invert_rigid(gv_from_world)
    cameras = tuple(
        homogeneous(view.camera_from_world) @ world_from_gv for view in reconstruction.views
    )
    return SceneInGV(reconstruction, cloud, cameras)
