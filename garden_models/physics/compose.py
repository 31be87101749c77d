"""Put placed objects and their supports together into a scene that can be simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import rigid, transform_points
from garden_models.physics.config import Compose
from garden_models.physics.convex_pieces import convex_pieces
from garden_models.physics.inertia import mass_properties
from garden_models.physics.levelling import bottom_gv, level_pieces, noise_m
from garden_models.physics.merge_supports import merge_supports
from garden_models.physics.separate import separate
from garden_models.physics.support_surfaces import find_support_surfaces
from garden_models.progress import Progress, silent
from garden_models.scene import (
    OK,
    Background,
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
    are moved apart. An object without a support is kept fixed where it is and reported
    ``degraded``.
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
    bodies = []
    for i, (mesh, placement) in enumerate(zip(meshes, placements, strict=True)):
        progress((i + 0.5) / (len(meshes) + 1), f"colliders of {mesh.name}")
        support = next((s for s in supports if s.name == carriers[i]), None)
        bodies.append(make_body(mesh, placement, carriers[i], support, config))
    progress(len(meshes) / (len(meshes) + 1), "moving overlapping bodies apart")
    apart = _apart(tuple(bodies), supports, config)
    verdict = OK
    for body in apart:
        verdict = verdict.worst(body.verdict)
    if scale.source in ("unknown", "prior"):
        remark = f"sizes and masses rest on an assumed scale: {scale.metres_per_unit:g} m per unit"
        verdict = verdict.worst(Verdict("ok", (remark,)))
    return SimScene(apart, supports, scale, verdict)


def make_body(
    mesh: ObjectMesh,
    placement: Placement,
    carrier: str,
    support: SupportSurface | None,
    config: Compose,
) -> Body:
    """Return one object as a body that stands on its support.

    ``carrier`` names what carries it (a support, another object, or "" for nothing);
    ``support`` is the surface if it is one.
    """
    hypothesis = placement.best
    vertices = np.asarray(mesh.vertices, np.float64) * hypothesis.scale
    gv_from_body = rigid(hypothesis.rotation_gv, hypothesis.translation_gv)
    size = float(np.ptp(vertices, axis=0).max())
    tolerance = noise_m(vertices, config.noise)
    pieces = convex_pieces(vertices, mesh.faces, tolerance, config.convexity)
    mass = mass_properties(vertices, mesh.faces, config.density)
    reasons: list[str] = []
    remarks: list[str] = []
    lifted = 0.0
    if support is not None:
        below = bottom_gv(transform_points(gv_from_body, vertices), config.noise)
        inside = below - support.height_gv
        # Within the noise it stays where it is: levelling the colliders takes up the rest.
        if inside > tolerance:
            lifted = inside - tolerance
        elif -config.lowest_drop * size <= inside < -0.5 * tolerance:
            lifted = inside
        if lifted > config.most_shift * size:
            reasons.append(
                f"{mesh.name} was lifted {lifted:.3g} m ({lifted / size:.0%} of its size) out of "
                f"{support.name}"
            )
        elif inside < -config.lowest_drop * size:
            reasons.append(
                f"{mesh.name} starts {-inside:.3g} m above {support.name}, more than the noise of "
                "its mesh, so it drops"
            )
        gv_from_body[1, 3] -= lifted
        pieces = level_pieces(pieces, gv_from_body, support.height_gv, tolerance)
        remarks.append(
            f"the colliders' lowest {tolerance * 1e3:.2g} mm, the noise of the mesh, were made "
            f"level with {support.name}"
        )
    elif not carrier:
        reasons.append(f"nothing was found that carries {mesh.name}: it is kept fixed in its place")
    return Body(
        name=mesh.name,
        vertices=vertices,
        faces=mesh.faces,
        vertex_rgb=mesh.vertex_rgb,
        colliders=pieces,
        mass_kg=mass.mass_kg,
        centre_of_mass=mass.centre_of_mass,
        inertia=mass.inertia,
        friction=config.friction,
        gv_from_body=gv_from_body,
        lifted_m=float(lifted),
        supported_by=carrier,
        physics_note="; ".join(
            [
                mass.note,
                f"friction {config.friction:g}, assumed (dry wood, plastic, ceramics: 0.3 to 0.6)",
                f"{len(pieces)} convex collider{'s' if len(pieces) > 1 else ''}",
                *remarks,
            ]
        ),
        verdict=Verdict("degraded", tuple(reasons)) if reasons else OK,
    )


def _placed_vertices_gv(mesh: ObjectMesh, placement: Placement) -> Float[np.ndarray, "v 3"]:
    """Return the vertices of a mesh at its chosen pose in GV."""
    return transform_points(placement.best.gv_from_object, np.asarray(mesh.vertices, np.float64))


def _apart(
    bodies: tuple[Body, ...], supports: tuple[SupportSurface, ...], config: Compose
) -> tuple[Body, ...]:
    """Move overlapping bodies apart and say so on each."""
    moves, left = separate(bodies, supports, config.separation)
    out = []
    for body, move in zip(bodies, moves, strict=True):
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
                verdict=verdict,
            )
        )
    return tuple(out)
