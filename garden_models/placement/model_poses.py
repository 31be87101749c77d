"""Bring a pose estimator's answers into the gate, and say if they are of no use."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from garden_models.foundation.failure import ModelFailed
from garden_models.geometry.rigid import invert_rigid
from garden_models.meshing.best_view import best_view
from garden_models.placement.config import PlaceObject
from garden_models.placement.pose import UprightPose
from garden_models.placement.pose_model import EstimatePose, PoseRequest
from garden_models.scene import (
    BadGeometry,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    PlacementHypothesis,
    Reconstruction,
    Verdict,
)

MOST_BEHIND = 0.15
"""Total score by which a model that works may miss the best pose."""

UPRIGHT, FREE = "FoundationPose, upright", "FoundationPose, free"


@dataclass(frozen=True)
class ModelPoses:
    """The model's poses by name, each kind best first, and why some are missing."""

    poses: dict[str, UprightPose] = field(default_factory=dict)
    failures: tuple[str, ...] = ()


def ask_model(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    estimate: EstimatePose,
    config: PlaceObject,
) -> ModelPoses:
    """Return the model's poses (GV) from the photo that shows the object best."""
    kinds = {"upright": (UPRIGHT,), "free": (FREE,), "both": (UPRIGHT, FREE)}[config.rotations]
    poses: dict[str, UprightPose] = {}
    failures: list[str] = []
    for kind in kinds:
        try:
            found = _ask(
                reconstruction, gravity_view, masks, mesh, estimate, config, kind == UPRIGHT
            )
        except (BadGeometry, ModelFailed) as problem:
            failures.append(f"{kind}: {problem}")
            continue
        poses |= {f"{kind}, {i + 1}": pose for i, pose in enumerate(found)}
    return ModelPoses(poses, tuple(failures))


def _ask(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    masks: ObjectMasks,
    mesh: ObjectMesh,
    estimate: EstimatePose,
    config: PlaceObject,
    upright: bool,
) -> list[UprightPose]:
    index = best_view(reconstruction, masks)
    view = reconstruction.views[index]
    gv_from_camera = gravity_view.gv_from_world @ invert_rigid(view.camera_from_world)
    scale = UprightPose.of(mesh.gv_from_object).scale
    answer = estimate(
        PoseRequest(
            rgb=view.rgb,
            depth=np.asarray(view.depth, np.float32),
            K=view.K,
            mask=masks.masks[index],
            vertices=np.asarray(mesh.vertices, float) * scale,
            faces=mesh.faces,
            vertex_rgb=mesh.vertex_rgb,
            gv_from_camera=gv_from_camera[:3, :3],
            upright=upright,
            iterations=config.iterations,
            keep=config.model_poses if config.gate else 1,
        )
    )
    out = []
    for camera_from_object in answer.camera_from_object:
        gv_from_object = gv_from_camera @ camera_from_object
        out.append(UprightPose(0.0, gv_from_object[:3, 3], scale, gv_from_object[:3, :3]))
    return out


def judge_model(
    answered: ModelPoses,
    scored: tuple[PlacementHypothesis, ...],
    chosen: int,
    name: str,
) -> Verdict:
    """Return degraded if the model gave no pose, or none that comes near the chosen one.

    What the model was given, or how its answer was read, is then wrong.
    """
    problems = [f"for {name!r}, {failure}" for failure in answered.failures]
    own = [one for one in scored if one.name in answered.poses]
    if own:
        best = max(own, key=lambda one: one.scores["total"])
        taken = scored[chosen]
        if best.scores["total"] < taken.scores["total"] - MOST_BEHIND:
            problems.append(
                f"FoundationPose's poses of {name!r} explain the photos far worse than "
                f"{taken.name!r}, which was taken: the best, {best.name!r}, has the total "
                f"{best.scores['total']:.2f} (mask IoU {best.scores['mask_iou']:.2f}) against "
                f"{taken.scores['total']:.2f}"
            )
    return Verdict("degraded" if problems else "ok", tuple(problems))
