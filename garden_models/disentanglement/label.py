"""Label a reconstruction's points for one object: crop, classify, put back."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.disentanglement.config import LabelPoints
from garden_models.disentanglement.protocol import Crop, PlacedMesh, ViewEvidence, classifier
from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.progress import Progress, silent
from garden_models.scene import (
    OK,
    BadInput,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PointCloud,
    PointLabels,
    Reconstruction,
    Verdict,
)


def label_points(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    placement: Placement,
    config: LabelPoints = LabelPoints(),
    progress: Progress = silent,
) -> PointLabels:
    """Return every point's probability of being part of the object; 0 outside the crop.

    Raises BadInput if masks, mesh and placement are of different targets or the masks of
    other photos.
    """
    names = {masks.target.name, mesh.name, placement.name}
    if len(names) > 1:
        raise BadInput(f"masks, mesh and placement are of different targets: {sorted(names)}")
    if masks.photos != tuple(view.photo for view in reconstruction.views):
        raise BadInput(
            f"the masks of {mesh.name} are of other photos than the reconstruction: "
            "segment it again"
        )
    points_gv = cloud_in_gv(reconstruction.points_world, gravity_view)
    vertices = transform_points(placement.best.gv_from_object, np.asarray(mesh.vertices, float))
    placed = PlacedMesh(vertices, mesh.faces)
    near = relaxed_box(points_gv, placed, config.relaxed)
    crop = Crop(
        points_gv.subset(near),
        placed,
        view_evidence(reconstruction, gravity_view, masks, config.most_views),
        masks.support,
    )
    probability = np.zeros(len(points_gv), np.float32)
    probability[near] = classifier(config.method, config.weights)(crop, progress)
    removed = int((probability >= config.threshold).sum())
    verdict = OK
    if not removed:
        verdict = Verdict(
            "degraded",
            (f"no point of the scene belongs to {mesh.name} where it was placed",),
        )
    return PointLabels(mesh.name, config.method, probability, config.threshold, verdict)


def cloud_in_gv(points_world: PointCloud, gravity_view: GravityView) -> PointCloud:
    """Return the cloud in Gravity-View."""
    gv_from_world = gravity_view.gv_from_world
    return PointCloud(
        transform_points(gv_from_world, np.asarray(points_world.xyz, np.float64)),
        points_world.rgb,
        points_world.normal @ gv_from_world[:3, :3].T,
        points_world.spacing,
        points_world.confidence,
    )


def view_evidence(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    most_views: int,
) -> tuple[ViewEvidence, ...]:
    """Return depth and mask of the photos that show the object, evenly picked."""
    world_from_gv = invert_rigid(gravity_view.gv_from_world)
    seeing = [i for i, mask in enumerate(masks.masks) if mask.any()]
    if len(seeing) > most_views:
        picked = np.linspace(0, len(seeing) - 1, most_views).round().astype(int)
        seeing = [seeing[i] for i in picked]
    return tuple(
        ViewEvidence(
            reconstruction.views[i].K,
            homogeneous(reconstruction.views[i].camera_from_world) @ world_from_gv,
            reconstruction.views[i].depth,
            masks.masks[i],
        )
        for i in seeing
    )


def relaxed_box(points_gv: PointCloud, mesh: PlacedMesh, relaxed: float) -> Bool[np.ndarray, " n"]:
    """Tell which points are in the mesh's gravity-aligned box, grown but not downwards."""
    margin: Float[np.ndarray, "3"] = np.full(3, relaxed * mesh.size)
    low = mesh.vertices_gv.min(axis=0) - margin
    high = mesh.vertices_gv.max(axis=0) + margin * np.array([1.0, 0.2, 1.0])
    return np.asarray(((points_gv.xyz >= low) & (points_gv.xyz <= high)).all(axis=1))
