"""Put placed objects and their supports together into a scene that can be simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import transform_points
from garden_models.physics.body import make_body
from garden_models.physics.config import Compose
from garden_models.physics.levelling import noise_m
from garden_models.physics.merge_supports import merge_supports
from garden_models.physics.mujoco_warnings import collect_warnings
from garden_models.physics.separate import separate
from garden_models.physics.support_surfaces import find_support_surfaces
from garden_models.physics.trimming import deep_contacts_gv, trim_overlaps
from garden_models.progress import Progress, silent
from garden_models.scene import (
    OK,
    Background,
    BadGeometry,
    BadInput,
    Body,
    GravityView,
    ObjectMasks,
    ObjectMesh,
    Placement,
    Scale,
    SimScene,
    SupportSurface,
    Verdict,
)


def compose(
    meshes: tuple[ObjectMesh, ...],
    placements: tuple[Placement, ...],
    masks: tuple[ObjectMasks, ...],
    background: Background,
    gravity_view: GravityView,
    scale: Scale,
    config: Compose = Compose(),
    progress: Progress = silent,
    camera_centres_gv: Float[np.ndarray, "c 3"] | None = None,
) -> SimScene:
    """Return bodies with colliders and mass, standing on supports.

    ``meshes``, ``placements`` and ``masks`` belong together by position. Supports are the
    horizontal surfaces of the background and each object's own. Every object is set down on
    its support: lifted if it starts deeper inside than its mesh's noise, lowered if it is just
    above, its colliders levelled within that noise (see ``levelling``). Objects that overlap
    are trimmed (see ``trimming``) or, where that is not enough, moved apart. An object without
    a support is kept fixed where it is and reported ``degraded``; one whose mesh encloses
    nothing is left out and named in the verdict.
    ``camera_centres_gv`` defaults to the reference camera, the origin of Gravity-View.

    Raises BadInput if the three tuples do not belong together.
    """
    names = [mesh.name for mesh in meshes]
    if names != [p.name for p in placements] or names != [m.target.name for m in masks]:
        raise BadInput(
            f"meshes {names}, placements {[p.name for p in placements]} and masks "
            f"{[m.target.name for m in masks]} must be of the same targets in the same order"
        )
    centres = np.zeros((1, 3)) if camera_centres_gv is None else camera_centres_gv
    progress(0.0, "supports")
    found = find_support_surfaces(background.points_gv, centres, config.supports)
    placed = [_placed_vertices_gv(m, p) for m, p in zip(meshes, placements, strict=True)]
    supports, carriers = merge_supports(
        found, tuple(m.support for m in masks), names, placed, config.merge
    )
    with collect_warnings() as warned:
        bodies, verdict = _bodies(meshes, placements, carriers, supports, config, progress)
        progress(len(meshes) / (len(meshes) + 1), "moving overlapping bodies apart")
        apart = _apart(bodies, supports, config)
    if warned.reasons:
        verdict = verdict.worst(Verdict("degraded", warned.reasons))
    for body in apart:
        verdict = verdict.worst(body.verdict)
    if scale.source in ("unknown", "prior"):
        remark = f"sizes and masses rest on an assumed scale: {scale.metres_per_unit:g} m per unit"
        verdict = verdict.worst(Verdict("ok", (remark,)))
    return SimScene(apart, supports, scale, verdict)


def _bodies(
    meshes: tuple[ObjectMesh, ...],
    placements: tuple[Placement, ...],
    carriers: list[str],
    supports: tuple[SupportSurface, ...],
    config: Compose,
    progress: Progress,
) -> tuple[tuple[Body, ...], Verdict]:
    """Make every body, those that touch another with finer colliders there."""
    verdict = OK
    bodies: list[Body] = []
    inputs: list[tuple[ObjectMesh, Placement, str, SupportSurface | None]] = []
    for i, (mesh, placement) in enumerate(zip(meshes, placements, strict=True)):
        progress((i + 0.5) / (len(meshes) + 1), f"colliders of {mesh.name}")
        support = next((s for s in supports if s.name == carriers[i]), None)
        try:
            bodies.append(make_body(mesh, placement, carriers[i], support, config))
        except BadGeometry as problem:
            reason = f"{mesh.name} is left out of the simulation: {problem}"
            verdict = verdict.worst(Verdict("degraded", (reason,)))
            continue
        inputs.append((mesh, placement, carriers[i], support))
    touched = deep_contacts_gv(tuple(bodies), _allowed_trims(bodies, config))
    finer = [
        make_body(*given, config, points) if len(points) else body
        for body, given, points in zip(bodies, inputs, touched, strict=True)
    ]
    return tuple(_without_lost_carriers(finer, supports)), verdict


def _allowed_trims(bodies: Sequence[Body], config: Compose) -> list[float]:
    """Return how much of each body's colliders may be cut back (metres)."""
    return [config.trim * noise_m(body.vertices, config.noise) for body in bodies]


def _without_lost_carriers(bodies: list[Body], supports: tuple[SupportSurface, ...]) -> list[Body]:
    """Fix the bodies in place that stood on an object which was left out."""
    there = {"", *(body.name for body in bodies), *(support.name for support in supports)}
    out = []
    for body in bodies:
        if body.supported_by not in there:
            reason = f"{body.supported_by}, which carries {body.name}, was left out"
            verdict = body.verdict.worst(Verdict("degraded", (reason,)))
            out.append(replace(body, supported_by="", verdict=verdict))
        else:
            out.append(body)
    return out


def _placed_vertices_gv(mesh: ObjectMesh, placement: Placement) -> Float[np.ndarray, "v 3"]:
    """Return the vertices of a mesh at its chosen pose in GV."""
    return transform_points(placement.best.gv_from_object, np.asarray(mesh.vertices, np.float64))


def _apart(
    bodies: tuple[Body, ...], supports: tuple[SupportSurface, ...], config: Compose
) -> tuple[Body, ...]:
    """Trim or move overlapping bodies apart and say so on each."""
    bodies, trims = trim_overlaps(bodies, _allowed_trims(bodies, config), config.separation)
    moves, left = separate(bodies, supports, config.separation)
    out = []
    for body, move, trim in zip(bodies, moves, trims, strict=True):
        size = float(np.ptp(body.vertices, axis=0).max())
        pushed = float(np.hypot(move[0], move[2]))
        reasons = []
        if max(pushed, -move[1]) > config.most_shift * size:
            reasons.append(
                f"{body.name} was moved {np.linalg.norm(move):.3g} m "
                f"({np.linalg.norm(move) / size:.0%} of its size) out of what it overlapped"
            )
        if left > 10 * config.separation.allowed_overlap_m and np.any(move):
            reasons.append(f"{body.name} still overlaps something by up to {left:.3g} m")
        note = body.physics_note
        if trim > 0:
            note += f"; colliders cut back by up to {trim * 1e3:.2g} mm where they touched another"
        gv_from_body = body.gv_from_body.copy()
        gv_from_body[:3, 3] += move
        verdict = body.verdict
        if reasons:
            verdict = verdict.worst(Verdict("degraded", tuple(reasons)))
        out.append(
            replace(
                body,
                gv_from_body=gv_from_body,
                lifted_m=float(body.lifted_m - move[1]),
                pushed_m=pushed,
                physics_note=note,
                verdict=verdict,
            )
        )
    return tuple(out)
