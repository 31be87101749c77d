"""Integrate mass, centre of mass and inertia of closed meshes; state a density.

Integrals over the solid are sums over the tetrahedra between the origin and each face
(divergence theorem; Blow and Binstock 2004). They are exact for a closed, outward-facing mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from garden_models.physics.config import DensityPrior
from garden_models.scene import BadGeometry


@dataclass(frozen=True)
class SolidProperties:
    """Of a solid with density 1: ``volume`` (m^3), ``centroid`` (m) and ``inertia`` about the
    centroid (m^5). Times a density they are mass and inertia tensor.
    """

    volume: float
    centroid: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"]


@dataclass(frozen=True)
class MassProperties:
    """Mass (kg), centre of mass (m), inertia about it (kg m^2) and where they come from."""

    mass_kg: float
    centre_of_mass: Float[np.ndarray, "3"]
    inertia: Float[np.ndarray, "3 3"]
    note: str


DEFAULT_PRIOR = DensityPrior()


def solid_properties(
    vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]
) -> SolidProperties:
    """Integrate volume, centroid and inertia of a closed mesh.

    An inside-out mesh is turned. Raises BadGeometry if it encloses no volume.
    """
    vertices = np.asarray(vertices, np.float64)
    origin = vertices.mean(axis=0)
    a, b, c = np.moveaxis((vertices - origin)[faces], 1, 0)
    six_volumes = np.einsum("fi,fi->f", a, np.cross(b, c))
    volume = six_volumes.sum() / 6
    extent = np.prod(np.maximum(np.ptp(vertices, axis=0), 1e-12))
    if abs(volume) < 1e-9 * extent:
        raise BadGeometry("the mesh encloses no volume, so it has no mass: close it first")
    centroid = (six_volumes[:, None] * (a + b + c)).sum(axis=0) / (24 * volume)
    total = a + b + c
    second = sum(np.einsum("f,fi,fj->ij", six_volumes, p, p) for p in (a, b, c, total)) / 120
    second = second / np.sign(volume)
    volume = abs(volume)
    second = second - volume * np.outer(centroid, centroid)
    inertia = np.trace(second) * np.eye(3) - second
    return SolidProperties(float(volume), centroid + origin, inertia)


def mass_properties(
    vertices: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    prior: DensityPrior = DEFAULT_PRIOR,
) -> MassProperties:
    """Return the mass properties of a closed mesh in metres, filled evenly with the prior."""
    solid = solid_properties(vertices, faces)
    mass = float(np.clip(solid.volume * prior.density, prior.least_mass_kg, prior.most_mass_kg))
    density = mass / solid.volume
    note = (
        f"mass {mass:.3g} kg = {solid.volume * 1e3:.3g} litres x {density:.0f} kg/m^3, an assumed "
        f"mean density (plausible: {prior.low:.0f} to {prior.high:.0f}), spread evenly"
    )
    if not np.isclose(density, prior.density):
        note += f"; limited to {prior.least_mass_kg} to {prior.most_mass_kg} kg"
    return MassProperties(mass, solid.centroid, solid.inertia * density, note)
