"""Compare a factored scene with its exact truth (the sample capture, ``tests/scenes``)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from flows.benchmark.corner_truth import CornerTruth, TruthObject
from flows.benchmark.measure import Measure
from flows.report.values import ObjectValues, SceneValues
from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.metrics.camera_pose import (
    camera_pose_errors,
    centres_of,
    true_from_estimated_rotation,
)
from garden_models.metrics.gravity import angular_error_deg
from garden_models.metrics.mask import mean_intersection_over_union
from garden_models.metrics.mesh import compare_meshes
from garden_models.metrics.placement import shape_error
from garden_models.scene import Reconstruction

MIN_VISIBLE_PIXELS = 100
"""Views in which the truth shows less of an object say nothing of its mask."""


@dataclass(frozen=True)
class WorldAlignment:
    """The similarity from the estimated world to the true one, found from the cameras."""

    rotation: Float[np.ndarray, "3 3"]
    scale: float
    shift: Float[np.ndarray, "3"]

    def apply(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return points of the estimated world in the true world."""
        return self.scale * points @ self.rotation.T + self.shift


def measure_sample(values: SceneValues, truth: CornerTruth) -> list[Measure]:
    """Return every measure of the issue's acceptance on the sample capture."""
    reconstruction = values.reconstruction
    if reconstruction is None or values.gravity_view is None:
        raise ValueError("the scene has no reconstruction to compare with its truth")
    estimated, true = _paired_poses(reconstruction, truth)
    alignment = align_worlds(estimated, true)
    down_true = alignment.rotation @ values.gravity_view.down_world
    errors = camera_pose_errors(estimated, true)
    measures = [
        Measure("camera rotation error, median", float(np.median(errors.rotation_deg)), 0.3, "deg"),
        *_depth(reconstruction, truth, alignment.scale),
        Measure("gravity", angular_error_deg(down_true, truth.down_world), 0.7, "deg"),
    ]
    for factored in values.objects:
        measures += _object(factored, values, truth, alignment)
    for motion in values.trajectory.motions if values.trajectory else ():
        moved_mm = 1000 * motion.drift_m * alignment.scale
        measures.append(Measure(f"{motion.name}: moved after 10 s", moved_mm, 5.0, "mm"))
    return measures


def align_worlds(
    estimated: Float[np.ndarray, "n 3 4"], true: Float[np.ndarray, "n 3 4"]
) -> WorldAlignment:
    """Align by the cameras: rotation from their orientations, scale and shift from centres."""
    rotation = true_from_estimated_rotation(estimated, true)
    ours, theirs = centres_of(estimated) @ rotation.T, centres_of(true)
    ours_centred, theirs_centred = ours - ours.mean(0), theirs - theirs.mean(0)
    scale = float((ours_centred * theirs_centred).sum() / (ours_centred**2).sum())
    return WorldAlignment(rotation, scale, theirs.mean(0) - scale * ours.mean(0))


def _paired_poses(
    reconstruction: Reconstruction, truth: CornerTruth
) -> tuple[Float[np.ndarray, "n 3 4"], Float[np.ndarray, "n 3 4"]]:
    estimated = np.stack([view.camera_from_world for view in reconstruction.views])
    true = [
        invert_rigid(truth.view(view.photo).world_from_camera)[:3] for view in reconstruction.views
    ]
    return estimated, np.stack(true)


def _depth(reconstruction: Reconstruction, truth: CornerTruth, scale: float) -> list[Measure]:
    errors, valid, total = [], 0, 0
    for view in reconstruction.views:
        if view.photo not in truth.depths:
            continue
        size = view.size
        true = cv2.resize(
            truth.depths[view.photo].depth, size, interpolation=cv2.INTER_NEAREST_EXACT
        )
        known = true > 0
        both = known & (view.depth > 0)
        errors.append(np.abs(scale * view.depth[both] / true[both] - 1))
        valid, total = valid + int(both.sum()), total + int(known.sum())
    relative = np.concatenate(errors)
    return [
        Measure("depth error, median", 100 * float(np.median(relative)), 1.0, "%"),
        Measure("depth, valid pixels", 100 * valid / total, 80.0, "%", at_least=True),
    ]


def _object(
    factored: ObjectValues, values: SceneValues, truth: CornerTruth, alignment: WorldAlignment
) -> list[Measure]:
    assert values.gravity_view is not None
    name = factored.target.name
    true = truth.object(name)
    true_gv = truth_in_gv(true, values, alignment)
    mesh = factored.mesh
    placed = transform_points(factored.placement.best.gv_from_object, mesh.vertices)
    shape = compare_meshes(placed, mesh.faces, true_gv, true.faces)
    symmetry = None if true.yaw_symmetric else 1
    pose = shape_error(placed, mesh.faces, true_gv, true.faces, symmetry)
    measures = [
        Measure(f"{name}: mask IoU, mean", _mask_iou(factored, truth), 0.90, "", at_least=True),
        Measure(f"{name}: chamfer", 100 * shape.chamfer, 2.0, "% of size"),
        Measure(f"{name}: misplaced", 100 * pose.translation, 3.0, "% of size"),
    ]
    if not true.yaw_symmetric:
        measures.append(Measure(f"{name}: yaw", pose.yaw_deg, 5.0, "deg"))
    return measures


def truth_in_gv(
    true: TruthObject, values: SceneValues, alignment: WorldAlignment
) -> Float[np.ndarray, "v 3"]:
    """Return the true object's vertices in the estimated Gravity-View frame and its unit."""
    assert values.gravity_view is not None
    world = transform_points(true.world_from_object, true.vertices_object)
    estimated_world = ((world - alignment.shift) / alignment.scale) @ alignment.rotation
    return transform_points(values.gravity_view.gv_from_world, estimated_world)


def _mask_iou(factored: ObjectValues, truth: CornerTruth) -> float:
    ours, true = [], []
    for photo, mask in zip(factored.masks.photos, factored.masks.masks, strict=True):
        full = truth.mask(factored.target.name, photo)
        if full.sum() < MIN_VISIBLE_PIXELS:
            continue
        height, width = full.shape
        ours.append(
            cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0
        )
        true.append(full)
    return mean_intersection_over_union(tuple(ours), tuple(true))
