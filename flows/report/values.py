"""Load what a report shows, as far as the scene came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

from flows.scene_run import SceneResult
from garden_models.reconstruction.geometry_model import Gaussians
from garden_models.scene import (
    Background,
    Capture,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    PointLabels,
    Reconstruction,
    Renders,
    SimScene,
    SparseModel,
    Target,
    Trajectory,
)
from garden_models.targets.proposal import TargetProposal
from tasks.step import Ref, load

Noun = TypeVar("Noun")


@dataclass(frozen=True)
class ObjectValues:
    """One factored object's artifacts."""

    target: Target
    masks: ObjectMasks
    mesh: ObjectMesh
    placement: Placement
    labels: PointLabels


@dataclass(frozen=True)
class SceneValues:
    """A scene's artifacts; None where the flow did not get that far."""

    result: SceneResult
    capture: Capture | None
    cameras: SparseModel | None
    reconstruction: Reconstruction | None
    gravity_view: GravityView | None
    objects: tuple[ObjectValues, ...]
    background: Background | None
    scene: SimScene | None
    trajectory: Trajectory | None
    renders: Renders | None
    proposal: TargetProposal | None = None
    gaussians: Gaussians | None = None


def load_values(result: SceneResult) -> SceneValues:
    """Load all artifacts of a scene from the store (inside its run context)."""
    refs = result.refs
    objects = tuple(
        ObjectValues(
            o.target,
            load(o.masks, ObjectMasks),
            load(o.mesh, ObjectMesh),
            load(o.placement, Placement),
            load(o.labels, PointLabels),
        )
        for o in refs.objects
    )
    return SceneValues(
        result,
        _optional(refs.capture, Capture),
        _optional(refs.cameras, SparseModel),
        _optional(refs.reconstruction, Reconstruction),
        _optional(refs.gravity_view, GravityView),
        objects,
        _optional(refs.background, Background),
        _optional(refs.scene, SimScene),
        _optional(refs.trajectory, Trajectory),
        _optional(refs.renders, Renders),
        _optional(refs.proposal, TargetProposal),
        _optional(refs.gaussians, Gaussians),
    )


def _optional(ref: Ref | None, noun: type[Noun]) -> Noun | None:
    return None if ref is None else load(ref, noun)
