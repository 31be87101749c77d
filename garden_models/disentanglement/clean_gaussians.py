"""Take the objects' Gaussians out of a prediction, by the labels of the points next to them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool
from scipy.spatial import cKDTree

from garden_models.disentanglement.clean_gaussians_config import CleanGaussians
from garden_models.reconstruction.geometry_model import Gaussians, GeometryPrediction
from garden_models.reconstruction.similarity import Similarity
from garden_models.scene import BadInput, GravityView, PointCloud, PointLabels, Reconstruction

REACH = 4.0
"""An object claims Gaussians up to this many times the spacing of its points away."""
FINEST = 0.1
"""Cells that thin Gaussians are at first this share of their size."""


def clean_gaussians(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    prediction: GeometryPrediction,
    labels: Sequence[PointLabels],
    config: CleanGaussians = CleanGaussians(),
) -> Gaussians:
    """Return the Gaussians in GV (metres) that belong to no object, thinned.

    A Gaussian goes by its own mean: the labels of the fused point nearest to it decide, if that
    point is near. Raises BadInput if the prediction has no Gaussians, or labels are of another
    cloud.
    """
    if prediction.gaussians is None:
        raise BadInput("the prediction holds no Gaussians: set geometry.gaussians = true")
    points = reconstruction.points_world
    for label in labels:
        if len(label.probability) != len(points):
            raise BadInput(
                f"the labels of {label.name} are for {len(label.probability)} points, but the "
                f"reconstruction has {len(points)}: label it again"
            )
    metres = Similarity(reconstruction.scale.metres_per_unit, np.eye(3), np.zeros(3))
    cloud = metres.gaussians(prediction.gaussians)
    owned = np.zeros(len(points), bool)
    for label in labels:
        owned |= label.probability >= label.threshold
    kept = thinned(cloud.subset(~_of_objects(cloud, points, owned)), config.max_gaussians)
    gv = gravity_view.gv_from_world
    return Similarity(1.0, gv[:3, :3], gv[:3, 3]).gaussians(kept)


def thinned(cloud: Gaussians, most: int) -> Gaussians:
    """Return at most so many Gaussians: of those that share a cell of about their own size, a
    surface that many photos saw alike, the most opaque.

    Cells grow until few enough remain.
    """
    size = np.maximum(np.sort(cloud.scale, axis=1)[:, 1:].mean(axis=1), 1e-9)
    order = np.argsort(-cloud.opacity, kind="stable")
    factor = FINEST
    while len(cloud.mean) > most:
        level = np.round(np.log2(size[order] * factor)).astype(np.int64)
        cell = np.floor(cloud.mean[order] / np.exp2(level)[:, None]).astype(np.int64)
        _, first = np.unique(np.column_stack([level, cell]), axis=0, return_index=True)
        if len(first) <= most:
            keep = np.zeros(len(order), bool)
            keep[order[first]] = True
            return cloud.subset(keep)
        factor *= max(1.1, (len(first) / most) ** 0.5)
    return cloud


def _of_objects(
    cloud: Gaussians, points: PointCloud, owned: Bool[np.ndarray, " n"]
) -> Bool[np.ndarray, " g"]:
    if not owned.any():
        return np.zeros(len(cloud.mean), bool)
    xyz = np.asarray(points.xyz, np.float64)
    reach = REACH * points.spacing.astype(np.float64)
    lowest, highest = xyz[owned].min(axis=0), xyz[owned].max(axis=0)
    margin = float(reach[owned].max())
    near = ((cloud.mean > lowest - margin) & (cloud.mean < highest + margin)).all(axis=1)
    distance, index = cKDTree(xyz).query(cloud.mean[near], workers=-1)
    out = np.zeros(len(cloud.mean), bool)
    out[near] = owned[index] & (distance < reach[index])
    return out
