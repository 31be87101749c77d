"""Factorize one scene: the paper's figure 2, one line an arrow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from flows.preset import Preset
from flows.scene_geometry import (
    background_gaussians,
    by_model,
    fused_prediction,
    predicted_gravity,
    prediction_and_cameras,
)
from flows.target_proposal import looking_for_targets, targets_of, without_proposal
from garden_models.scene import Rivals, Target
from tasks.align_gravity import align_gravity
from tasks.clean_background import clean_background
from tasks.compose import compose
from tasks.find_rivals import find_rivals
from tasks.ingest import CaptureSource, ingest
from tasks.label_points import label_points
from tasks.mesh_object import mesh_object
from tasks.place_object import place_object
from tasks.reconstruct import reconstruct
from tasks.register import register
from tasks.render import render
from tasks.segment import segment
from tasks.simulate import simulate
from tasks.step import Postponed, Ref, StepFailed, fan_out


@dataclass(frozen=True)
class FactoredObject:
    """References to what was made of one target."""

    target: Target
    masks: Ref
    mesh: Ref
    placement: Ref
    labels: Ref


@dataclass
class SceneRefs:
    """References to every artifact of a scene, as far as it came; filled as the flow runs."""

    targets: tuple[Target, ...]
    capture: Ref | None = None
    prediction: Ref | None = None
    cameras: Ref | None = None
    proposal: Ref | None = None
    reconstruction: Ref | None = None
    gravity_view: Ref | None = None
    objects: tuple[FactoredObject, ...] = ()
    failed_targets: tuple[tuple[Target, StepFailed], ...] = ()
    background: Ref | None = None
    gaussians: Ref | None = None
    scene: Ref | None = None
    trajectory: Ref | None = None
    renders: Ref | None = None
    failure: StepFailed | None = None


def factorize_scene(
    source: CaptureSource, targets: tuple[Target, ...], preset: Preset, refs: SceneRefs
) -> SceneRefs:
    """Turn a capture into a settled scene; return (and fill) the references.

    Without targets those are taken that the preset's model proposes, while the photos are
    reconstructed. A failed target leaves the others alone; a failed registration or proposal
    ends the scene. Raises StepFailed.
    """
    refs.capture = ingest(source, preset.ingest)
    if by_model(preset):
        refs.prediction, refs.cameras = prediction_and_cameras(refs.capture, preset)
    else:
        refs.cameras = register(refs.capture, preset.register)
    if refs.cameras.failed:
        raise StepFailed(refs.cameras.step, "", "; ".join(refs.cameras.reasons), kind="BadGeometry")
    wanted = without_proposal(preset) if targets else preset
    with looking_for_targets(refs.capture, refs.cameras, wanted) as proposal:
        if refs.prediction is not None:
            found = fused_prediction(refs.capture, refs.cameras, refs.prediction, preset)
            refs.reconstruction = found
            refs.gravity_view = predicted_gravity(found, refs.prediction, preset)
        else:
            refs.reconstruction = reconstruct(refs.capture, refs.cameras, preset.reconstruct)
            refs.gravity_view = align_gravity(refs.reconstruction, preset.gravity)
        refs.proposal = proposal()
    if refs.proposal is not None:
        targets, refs.targets = targets_of(refs.proposal)
    factor = partial(factor_object, refs=refs, preset=preset)
    outcomes = list(zip(targets, fan_out(factor, targets), strict=True))
    for _, outcome in outcomes:
        if isinstance(outcome, Postponed):
            raise outcome
    refs.objects = tuple(o for _, o in outcomes if isinstance(o, FactoredObject))
    refs.failed_targets = tuple((t, o) for t, o in outcomes if isinstance(o, StepFailed))
    masks = tuple(o.masks for o in refs.objects)
    meshes = tuple(o.mesh for o in refs.objects)
    placements = tuple(o.placement for o in refs.objects)
    labels = tuple(o.labels for o in refs.objects)
    refs.background = clean_background(
        refs.reconstruction, refs.gravity_view, labels, masks, preset.background
    )
    refs.gaussians = background_gaussians(
        refs.reconstruction, refs.gravity_view, refs.prediction, labels, preset
    )
    refs.scene = compose(
        refs.reconstruction,
        refs.gravity_view,
        masks,
        meshes,
        placements,
        refs.background,
        preset.physics,
    )
    refs.trajectory = simulate(refs.scene, preset.simulation)
    refs.renders = render(
        refs.reconstruction,
        refs.gravity_view,
        refs.background,
        refs.scene,
        refs.trajectory,
        tuple(dict.fromkeys(t.photo for t in refs.targets)),
        preset.render,
    )
    return refs


def factor_object(target: Target, refs: SceneRefs, preset: Preset) -> FactoredObject:
    """Take one target out of the scene: mask, mesh, pose, and its points."""
    scene = refs.reconstruction, refs.gravity_view
    others = possible_rivals(target, refs.targets)
    rivals = find_rivals(*scene, target, others, preset.segment) if others else Rivals()
    masks = segment(*scene, target, rivals, preset.segment)
    mesh = mesh_object(*scene, masks, preset.mesh)
    placement = place_object(*scene, masks, mesh, preset.place)
    labels = label_points(*scene, masks, mesh, placement, preset.disentangle)
    return FactoredObject(target, masks, mesh, placement, labels)


def possible_rivals(target: Target, targets: tuple[Target, ...]) -> tuple[Target, ...]:
    """Return the other targets whose boxes could hold the same points: all but those of
    the same photo whose boxes lie apart from the target's.
    """

    def apart(other: Target) -> bool:
        (ax0, ay0, ax1, ay1), (bx0, by0, bx1, by1) = target.box, other.box
        return ax1 <= bx0 or bx1 <= ax0 or ay1 <= by0 or by1 <= ay0

    return tuple(
        other
        for other in targets
        if other.name != target.name and not (other.photo == target.photo and apart(other))
    )
