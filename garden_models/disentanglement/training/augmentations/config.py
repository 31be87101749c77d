"""Hold the settings of the augmentations (paper, supplement B.2), each with a switch.

The supplement states lengths for furniture: a voxel of 0.15 m, a translation of 0.36 m. A cup
moved by that stands beside its table. With ``relative`` set, lengths shrink in proportion for
objects smaller than ``reference_m``; without it they are the supplement's for every size.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from garden_models.scene import BadInput


@dataclass(frozen=True)
class Ghosting:
    """Duplicate layers that drift, as fused views of wrong poses leave them."""

    on: bool = True
    layers: tuple[int, int] = (5, 12)
    drift_voxels: tuple[float, float] = (0.2, 0.5)
    patch: tuple[float, float] = (0.02, 0.06)
    """Share of the points that one layer repeats: its nearest to a random place."""


@dataclass(frozen=True)
class ThinParts:
    """Slender parts bend, shift and break."""

    on: bool = True
    probability: float = 0.5
    radius_voxels: float = 0.4
    """Neighbourhood in which slenderness is measured."""
    least_linearity: float = 0.55
    bend_voxels: tuple[float, float] = (0.05, 0.25)
    broken: float = 0.25
    """Share of the slender points that may go missing."""


@dataclass(frozen=True)
class VirtualScan:
    """Only what enough of the virtual cameras see is kept, in proportion to how many do."""

    on: bool = True
    views: tuple[int, int] = (25, 45)
    least_views: int = 2
    image_px: int = 128
    field_of_view_deg: float = 60.0
    distance: tuple[float, float] = (0.8, 1.8)
    """Of the cloud's diagonal."""
    elevation_deg: tuple[float, float] = (5.0, 65.0)
    arc_deg: tuple[float, float] = (120.0, 360.0)
    depth_tolerance: float = 0.025


@dataclass(frozen=True)
class MeshJitter:
    """The condition's pose and scale are wrong, as a generated and placed mesh's are."""

    on: bool = True
    scale: tuple[float, float] = (0.65, 1.35)
    stretch: tuple[float, float] = (0.85, 1.15)
    yaw_deg: float = 20.0
    translation_m: float = 0.36
    gentle: float = 0.0
    """Share of the pairs whose jitter is a tenth of that: a placement that went well."""


@dataclass(frozen=True)
class StereoNoise:
    """Errors of multi-view stereo along the viewing ray.

    The values are what ``garden train point-classifier --fit-stereo tests/scenes/corner`` gives:
    our stereo's residuals on the five photos of the sample capture whose depth is known, cameras
    given. There the relative error is the same at all depths.
    """

    on: bool = True
    sigma: float = 0.00105
    """1-sigma of the relative depth error at ``reference_depth`` diagonals ..."""
    growth: float = 0.0
    """... and what is added to it for each further unit of depth."""
    correlated: float = 0.227
    """Share of that error's variance that neighbours have in common."""
    holes: float = 0.151
    """Share of a surface that has no depth, in patches."""
    edge_holes: float = 0.406
    """Share without depth next to a depth edge."""
    smeared: float = 0.007
    """Share of the depths next to an edge that lie between its two sides."""


@dataclass(frozen=True)
class Augmentations:
    """Which augmentations are applied, and how strongly."""

    ghosting: Ghosting = field(default_factory=Ghosting)
    thin_parts: ThinParts = field(default_factory=ThinParts)
    virtual_scan: VirtualScan = field(default_factory=VirtualScan)
    mesh_jitter: MeshJitter = field(default_factory=MeshJitter)
    stereo_noise: StereoNoise = field(default_factory=StereoNoise)
    each: float = 1.0
    """Probability with which each of them is applied to a pair."""
    voxel_m: float = 0.15
    relative: bool = True
    reference_m: float = 1.0

    def unit(self, size: float) -> float:
        """Return by what the supplement's lengths are multiplied for an object of ``size``."""
        return min(1.0, size / self.reference_m) if self.relative else 1.0


NAMES = ("ghosting", "thin_parts", "virtual_scan", "mesh_jitter", "stereo_noise")
PAPER = Augmentations(stereo_noise=StereoNoise(on=False), relative=False)
"""The supplement's four, with its lengths in metres for every object."""


def without(augmentations: Augmentations, *names: str) -> Augmentations:
    """Return the augmentations with some switched off. Raises BadInput for unknown names."""
    for name in names:
        if name not in NAMES:
            raise BadInput(f"no augmentation called {name!r}: there are {', '.join(NAMES)}")
        one = dataclasses.replace(getattr(augmentations, name), on=False)
        augmentations = dataclasses.replace(augmentations, **{name: one})
    return augmentations


NONE = without(Augmentations(), *NAMES)
