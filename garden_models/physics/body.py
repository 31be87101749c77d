"""Make a rigid body of a placed object: set down on its support, with colliders and mass."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.rigid import invert_rigid, rigid, transform_points
from garden_models.physics.config import Compose
from garden_models.physics.convex_pieces import convex_pieces
from garden_models.physics.inertia import mass_properties
from garden_models.physics.levelling import bottom_gv, level_pieces, noise_m
from garden_models.scene import OK, Body, ObjectMesh, Placement, SupportSurface, Verdict


def make_body(
    mesh: ObjectMesh,
    placement: Placement,
    carrier: str,
    support: SupportSurface | None,
    config: Compose,
    touched_gv: Float[np.ndarray, "n 3"] | None = None,
) -> Body:
    """Return one object as a body that stands on its support.

    ``carrier`` names what carries it (a support, another object, or "" for nothing);
    ``support`` is the surface if it is one. Around ``touched_gv``, where another object
    touches it, its colliders are finer. Raises BadGeometry for a mesh that encloses nothing.
    """
    hypothesis = placement.best
    vertices = np.asarray(mesh.vertices, np.float64) * hypothesis.scale
    gv_from_body = rigid(hypothesis.rotation_gv, hypothesis.translation_gv)
    size = float(np.ptp(vertices, axis=0).max())
    tolerance = noise_m(vertices, config.noise)
    focus = None
    if touched_gv is not None and len(touched_gv):
        focus = transform_points(invert_rigid(gv_from_body), touched_gv)
    pieces = convex_pieces(vertices, mesh.faces, tolerance, config.convexity, focus)
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
