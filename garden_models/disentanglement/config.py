"""Hold the settings of disentanglement (light to import: command lines read them)."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class LabelPoints:
    """Which classifier labels which points."""

    method: str = "geometric"
    weights: str = ""
    """A checkpoint for the method ``network``; empty: the one that is shipped."""
    threshold: float = 0.5
    relaxed: float = 0.35
    """The box of the mesh grows by this share of its size on every side but below (paper:
    relaxed 3D region by gravity-aligned box expansion)."""
    most_views: int = 40


@dataclass(frozen=True)
class GeometricRule:
    """Weights are log-odds; lengths are relative to the point's spacing or the mesh's size."""

    mesh_noise: float = 0.015
    """1-sigma noise of mesh and placement, of the object's size."""
    spacings: float = 2.0
    depth_tolerance: float = 0.015
    """Relative error of the depth maps within which a point is visible."""
    distance_weight: float = 2.0
    most_inside: float = 2.5
    least_outside: float = -1.0
    """Bounds of the distance's evidence in tolerances: however far, masks can outvote it."""
    mask_weight: float = 3.5
    enough_votes: float = 3.0
    """Photos from which on the masks' share counts in full."""
    ghost_weight: float = 3.0
    ghost_reach: float = 0.1
    """How far from the mesh, of its size, a floating point counts as the object's ghost, and a
    surrounded cluster as its part."""
    support_weight: float = 2.0
    """Log-odds of being support on its layer: only masks of most photos outvote it (that
    costs little where they are wrong: the support is filled again)."""

    link_spacings: float = 2.5
    least_surrounded: float = 0.7
    """Share of a cluster's links to other points that must lead to the object's."""
    enclosed: float = 0.75
    """Probability that such a cluster gets."""


@dataclass(frozen=True)
class Inpainting:
    """Sizes in pixels of the texture."""

    patch: int = 7
    context: float = 0.7
    """How far around the hole patches are looked for, relative to its extent."""
    rim_px: float = 3.0
    """Width of the hole's rim at the coarsest level, which the start does not look at."""
    coarsest_px: int = 24
    """Shorter side of the coarsest level."""
    rounds: int = 10
    components: int = 12
    """Principal components in which patches are compared."""
    locality: float = 0.3
    """Price of looking far away: a patch across the texture is as unlike as one whose pixels
    differ by this share of the texture's contrast."""
    least_known: float = 0.6
    """Share of a source patch that was seen; the rest are gaps of the sampling."""
    most_sources: int = 8000
    approximation: float = 0.3
    """Found patches may be this much (relative) worse than the best: half the time."""
    seed: int = 0


@dataclass(frozen=True)
class LookUp:
    """What counts as seen."""

    depth_tolerance: float = 0.015
    """Relative error of depth maps."""
    mask_margin: float = 0.01
    """Objects' masks grow by this share of the picture's width: rims are mixed colours."""
    most_spread: float = 25.0
    """Median deviation (of 255) over which photos without depth do not agree on a colour."""
    least_unsure: int = 2
    """Photos that must agree on a colour where none has depth there."""


@dataclass(frozen=True)
class FillHole:
    """Lengths are relative to the points' spacing or the removed object's size."""

    reach: float = 0.08
    """How far around the object the support may lack points because of it: at its foot depth
    maps are cautious."""
    shadow: float = 1.0
    """How far around the object places may lie that it hid from the photos."""
    least_blocked: float = 0.3
    """Share of the photos of a place in which an object is before it."""
    margin: float = 0.2
    """How far around that the texture is looked at."""
    layer_spacings: float = 2.5
    """Points this near to the support's plane are support."""
    most_slope: float = 0.06
    """Steepest lean of a support, as in its detection: three and a half degrees."""
    contact: float = 0.08
    """Width of the rim around what no photo shows, of the object's size, that is invented
    too: it holds the object's contact shadow and mixed colours."""
    most_cells: int = 480
    """Cells of the texture's longer side; cells grow beyond the spacing to keep to it."""
    look_up: LookUp = field(default_factory=LookUp)
    inpainting: Inpainting = field(default_factory=Inpainting)


@dataclass(frozen=True)
class CleanBackground:
    """How leftovers are recognised, and how holes are filled."""

    near: float = 0.15
    """Leftovers lie within this share of the object's size around it."""
    link_spacings: float = 2.5
    """Points closer than this many spacings hang together."""
    most_leftover: float = 0.25
    """A cluster of more points than this share of the object's is a thing of its own."""
    most_rim: float = 0.1
    least_likely: float = 0.15
    """Mean probability from which a cluster of at most ``most_rim`` of the object's points
    goes with it: the frayed rim of the object, not a thing that stands beside it."""
    most_speck: float = 0.01
    """A cluster of fewer points than this share of the object's goes in any case."""
    layer_spacings: float = 2.5
    """Points this near to the support's plane are support."""
    hole: FillHole = field(default_factory=FillHole)
