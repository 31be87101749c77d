"""Tell the object's points from the background's by distance, masks and free space.

Four kinds of evidence are added up as log-odds:

- the signed distance to the placed mesh, in units of a tolerance that grows with the point's
  spacing and the mesh's noise;
- the share of photos that see the point on the object's mask: it decides near the surface,
  where a touching neighbour is as close as the object itself, and for parts that the mesh
  lacks;
- photos that see through a point: it floats (a ghost) and, next to the object, goes with it;
- the support: points on its plane stay, but for those that the object stands on.

Last, clusters next to the mesh that only the object's points surround go with it: masks
have holes where a print or a shadow looks like something else.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from garden_models.disentanglement.config import GeometricRule
from garden_models.disentanglement.mask_votes import Votes, mask_votes
from garden_models.disentanglement.protocol import Crop, PlacedMesh
from garden_models.disentanglement.signed_distance import inside_mesh, signed_distance
from garden_models.progress import Progress, silent
from garden_models.scene import PointCloud, SupportSurface

DEFAULT = GeometricRule()


def classify(
    crop: Crop, progress: Progress = silent, config: GeometricRule = DEFAULT
) -> Float[np.ndarray, " n"]:
    """Return each point's probability of being part of the object."""
    points, mesh = crop.points_gv, crop.mesh
    if not len(points):
        return np.zeros(0)
    tolerance = config.spacings * points.spacing + config.mesh_noise * mesh.size
    # Nothing below asks for distances beyond the ghosts' reach or three tolerances.
    reach = max(config.ghost_reach * mesh.size, 3 * float(tolerance.max())) * 1.01
    distance = signed_distance(points.xyz, mesh.vertices_gv, mesh.faces, reach)
    progress(0.5, "masks of all photos")
    votes = mask_votes(points, crop.views, config.depth_tolerance)
    masks = _mask_evidence(votes, config)
    evidence = _distance_evidence(distance, tolerance, config) + masks
    evidence += _ghost_evidence(distance, votes, mesh, config)
    if crop.support is not None:
        evidence = _keep_support(evidence, masks, points, mesh, crop.support, config)
    probability = 1 / (1 + np.exp(-evidence))
    near = distance < np.maximum(tolerance, config.ghost_reach * mesh.size)
    probability[_enclosed(points, probability >= 0.5, near, config)] = config.enclosed
    return np.asarray(probability)


def _distance_evidence(
    distance: Float[np.ndarray, " n"],
    tolerance: Float[np.ndarray, " n"],
    config: GeometricRule,
) -> Float[np.ndarray, " n"]:
    """Return positive log-odds inside of the mesh and within the tolerance around it."""
    depth = np.clip(1 - distance / tolerance, config.least_outside, config.most_inside)
    return np.asarray(config.distance_weight * depth)


def _mask_evidence(votes: Votes, config: GeometricRule) -> Float[np.ndarray, " n"]:
    """Return log-odds from the balance of photos, trusted with their number."""
    balance = (votes.on_object - votes.off_object) / np.maximum(votes.visible, 1)
    trust = np.minimum(votes.visible / config.enough_votes, 1)
    return np.asarray(config.mask_weight * balance * trust)


def _ghost_evidence(
    distance: Float[np.ndarray, " n"], votes: Votes, mesh: PlacedMesh, config: GeometricRule
) -> Float[np.ndarray, " n"]:
    """Return log-odds for points near the object that photos see through."""
    total = votes.visible + votes.seen_through
    share = votes.seen_through / np.maximum(total, 1)
    trust = np.minimum(total / config.enough_votes, 1)
    near = distance < config.ghost_reach * mesh.size
    return np.where(near & (share > 0.5), config.ghost_weight * share * trust, 0.0)


def _keep_support(
    evidence: Float[np.ndarray, " n"],
    masks: Float[np.ndarray, " n"],
    points_gv: PointCloud,
    mesh: PlacedMesh,
    support: SupportSurface,
    config: GeometricRule,
) -> Float[np.ndarray, " n"]:
    """Decide the support's layer, and what is below it, by what stands on it.

    A point of the layer is asked again from above the layer: if the mesh is there, the
    object stands on it and it goes (the hole is filled), else masks alone may take it.
    """
    height = support.height_gv - points_gv.xyz[:, 1]
    thickness = config.spacings * points_gv.spacing
    low = height <= thickness
    above = points_gv.xyz[low].copy()
    # High enough to be clear of the mesh's own noise at its bottom.
    above[:, 1] = support.height_gv - thickness[low] - config.mesh_noise * mesh.size
    under = inside_mesh(above, trimesh.Trimesh(mesh.vertices_gv, mesh.faces, process=False))
    under &= height[low] >= -2 * thickness[low]
    out = evidence.copy()
    out[low] = np.where(under, config.distance_weight, masks[low] - config.support_weight)
    return out


def _enclosed(
    points: PointCloud,
    is_object: Bool[np.ndarray, " n"],
    near: Bool[np.ndarray, " n"],
    config: GeometricRule,
) -> Int[np.ndarray, " m"]:
    """Return points near the mesh in clusters that are linked to little but the object."""
    open_question = near & ~is_object
    if not open_question.any() or not is_object.any():
        return np.zeros(0, np.int64)
    reach = config.link_spacings * float(np.median(points.spacing))
    pairs = cKDTree(points.xyz).query_pairs(reach, output_type="ndarray")
    first, second = pairs[:, 0], pairs[:, 1]
    inner = open_question[first] & open_question[second]
    n = len(points)
    graph = coo_array((np.ones(inner.sum()), (first[inner], second[inner])), shape=(n, n))
    count, cluster = connected_components(graph, directed=False)
    to_object, to_other = np.zeros(count), np.zeros(count)
    for here, there in ((first, second), (second, first)):
        border = open_question[here] & ~open_question[there]
        weight = is_object[there[border]].astype(float)
        to_object += np.bincount(cluster[here[border]], weight, count)
        to_other += np.bincount(cluster[here[border]], 1 - weight, count)
    surrounded = to_object > config.least_surrounded * np.maximum(to_object + to_other, 1)
    return np.flatnonzero(open_question & surrounded[cluster])
