"""Write the background as points and as Gaussians, z up."""

from __future__ import annotations

import numpy as np

from flows.package.frames import ZUP_FROM_GV
from garden_models.geometry.rigid import transform_points
from garden_models.reconstruction.geometry_model import Gaussians
from garden_models.reconstruction.similarity import Similarity
from garden_models.reconstruction.surfels import Surfels, surfels
from garden_models.scene import Background, PointCloud
from storage.formats.ply import gaussians_ply, points_ply

LEAST_SCALE = 1e-6
MOST_OPACITY = 0.9999
"""A logit has no end: opacities are kept inside of this and its complement."""


def background_files(background: Background, gaussians: Gaussians | None) -> dict[str, bytes]:
    """Return ``points.ply`` and ``splat.ply``.

    Predicted Gaussians are written as they are, with discs where a hole was filled; without
    them every point is a disc.
    """
    points = background.points_gv
    xyz = transform_points(ZUP_FROM_GV, points.xyz)
    normal = points.normal @ ZUP_FROM_GV[:3, :3].T
    return {
        "background/points.ply": points_ply(xyz, points.rgb, normal),
        "background/splat.ply": _discs_ply(points)
        if gaussians is None
        else _gaussians_ply(gaussians, points.subset(background.filled)),
    }


def _discs(points: PointCloud) -> Surfels:
    xyz = transform_points(ZUP_FROM_GV, points.xyz)
    return surfels(xyz, points.normal @ ZUP_FROM_GV[:3, :3].T, points.spacing)


def _discs_ply(points: PointCloud) -> bytes:
    discs = _discs(points)
    return gaussians_ply(
        discs.means, discs.scales, discs.quaternions_wxyz, discs.opacities, points.rgb
    )


def _gaussians_ply(gaussians: Gaussians, filled: PointCloud) -> bytes:
    zup = Similarity(1.0, ZUP_FROM_GV[:3, :3], ZUP_FROM_GV[:3, 3]).gaussians(gaussians)
    discs = _discs(filled)
    return gaussians_ply(
        np.concatenate([zup.mean, discs.means]),
        np.maximum(np.concatenate([zup.scale, discs.scales]), LEAST_SCALE),
        np.concatenate([zup.rotation, discs.quaternions_wxyz]),
        np.clip(np.concatenate([zup.opacity, discs.opacities]), 1 - MOST_OPACITY, MOST_OPACITY),
        np.concatenate([np.rint(zup.rgb * 255).astype(np.uint8), filled.rgb]),
    )
