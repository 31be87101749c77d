"""Hold the settings of object meshing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class MeshObject:
    """How an object's mesh is made from its masked depth maps and silhouettes.

    Lengths are relative to the object, its voxels or the photos' pixels, so that the same
    settings serve any scale.
    """

    method: Literal["fusion", "sam3d_objects"] = "fusion"
    """Whether the photos' depth and silhouettes are fused, or a model completes the object."""

    max_resolution: int = 160
    """Most voxels along the object's longest side; fewer where pixels are coarser."""

    min_resolution: int = 56
    """Fewest voxels along the longest side, however small the object is in the photos."""

    hull_outvoted_share: float = 0.08
    """Share of the views that may wrongly call a point empty before the hull believes them."""

    mirror: bool = True
    """Complete unseen parts by mirror symmetry where the seen parts prove it."""

    smoothing_steps: int = 12
    """Taubin smoothing steps; they keep the volume."""

    geometry_faces: int = 12_000
    """Faces kept for the shape."""

    max_faces: int = 24_000
    """Faces after edges were split where a straight blend of vertex colours misses detail."""

    min_observed: float = 0.5
    """Share of the surface (without its underside) seen below which the mesh is degraded."""

    min_observed_one_sided: float = 0.75
    """The same where all views come from one side, so that the far side is a guess."""

    seed: int = 0
    """Seed of the point samples."""

    def __post_init__(self) -> None:
        if not 16 <= self.min_resolution <= self.max_resolution:
            raise ValueError(
                "min_resolution must be at least 16 and at most max_resolution, got "
                f"{self.min_resolution} and {self.max_resolution}"
            )
        if not 100 <= self.geometry_faces <= self.max_faces:
            raise ValueError(
                "geometry_faces must be at least 100 and at most max_faces, got "
                f"{self.geometry_faces} and {self.max_faces}"
            )
        if not 0.0 <= self.hull_outvoted_share < 0.5:
            raise ValueError(
                f"hull_outvoted_share must be in 0..0.5, got {self.hull_outvoted_share}"
            )
