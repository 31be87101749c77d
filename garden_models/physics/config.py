"""Hold the settings of supports, bodies and their simulation."""

from __future__ import annotations

from dataclasses import dataclass, field

GRAVITY = 9.81


TIMESTEP = 0.001


ITERATIONS = 50


@dataclass(frozen=True)
class FindSupports:
    """How supports are told from everything else. Lengths are relative to the points' own
    spacing and noise, areas to the area of all points that face up.
    """

    max_slope_deg: float = 25.0
    """Normals further than this from gravity do not face up; generous, for noisy normals."""
    max_tilt_deg: float = 4.0
    """How far a whole surface may lean: the error of gravity, and of floors and tables."""
    band_sigma: float = 3.0
    """Points this many noise levels off a surface still belong to it."""
    min_area_share: float = 0.01
    max_peaks: int = 16
    cell_spacings: float = 2.5
    """Side of a cell of the outline grid: two points of one surface are closer than this."""
    patch_share: float = 0.05
    """A surface of less than this share of the largest one is a patch."""
    below_floor_share: float = 0.02
    """Nothing lies below a floor, but for this share of all area (stray points)."""
    max_points: int = 200_000


@dataclass(frozen=True)
class MergeSupports:
    """When two surfaces are one. Lengths are relative to the object that stands there."""

    same_height: float = 0.1
    """Surfaces under one object that differ by less than this share of its height."""
    foot: float = 0.1
    """Lowest share of an object's height that counts as its footprint."""
    least_overlap: float = 0.3
    """Share of the footprint that must lie over a surface for it to be the same surface."""


@dataclass(frozen=True)
class Cutting:
    """How finely a mesh is cut."""

    most_pieces: int = 24
    most_empty: float = 0.05
    """Empty space in all hulls together, relative to the mesh's volume, that may stay."""
    most_out: float = 0.03
    """How far a piece may reach out of the mesh, beside its noise, of the mesh's extent."""
    most_out_in_focus: float = 0.005
    focus_pieces: int = 16
    """Closer limit, and further pieces, where another object touches."""
    least_gain: float = 0.2
    """A part that holds less than this share of the empty space that may stay is not cut for
    it."""
    positions: int = 7
    """Planes that are tried per axis."""
    balance: float = 0.02
    """Price of an uneven cut, relative to the part's hull: a ring, whose first cut gains
    nothing anywhere, is cut through the middle."""
    surface_points: int = 3000
    """Points that candidate hulls are made of; the pieces themselves use all."""
    cells: int = 40
    """Cells along the longest axis of the grid that measures how much of a hull is filled."""
    seed: int = 0


@dataclass(frozen=True)
class Convexity:
    """How colliders follow a mesh."""

    cutting: Cutting = field(default_factory=Cutting)
    most_hull_vertices: int = 64
    """As many as MJX and MuJoCo Warp take."""
    thinnest: float = 1e-3
    """Pieces thinner than this share of the mesh's longest extent are dropped."""


@dataclass(frozen=True)
class MeshNoise:
    """What of a mesh is noise, relative to the object."""

    of_size: float = 0.015
    """1-sigma noise of a fused mesh relative to its longest extent is 1 to 2 %."""
    of_height: float = 0.1
    """Never more than this share of the height: a thin object stays an object."""
    lowest_share: float = 0.005
    """Share of the vertices (at least eight) whose mean height is the bottom: one spike is
    noise, the feet of a chair are not."""


@dataclass(frozen=True)
class DensityPrior:
    """The assumed mean density of a thing of unknown material, in kg/m^3.

    Photos do not tell mass. Of the YCB object set (Calli et al. 2015) packed food weighs 200
    to 1000 kg per m^3 of outer volume; toys, crockery and furniture, which are mostly air
    inside their outline, lie between 100 and 800. The prior is in the middle in ratio.
    Accelerations at rest, sliding and tipping under gravity do not depend on it.
    """

    density: float = 400.0
    low: float = 100.0
    high: float = 1500.0
    least_mass_kg: float = 0.002
    most_mass_kg: float = 500.0


@dataclass(frozen=True)
class Separation:
    """When bodies count as apart, in metres."""

    allowed_overlap_m: float = 1e-4
    gap_m: float = 2e-4
    """Air left between bodies that were moved apart: under the 1 mm that would be seen."""
    steps: int = 200


@dataclass(frozen=True)
class Compose:
    """Settings of every part of composing."""

    supports: FindSupports = field(default_factory=FindSupports)
    merge: MergeSupports = field(default_factory=MergeSupports)
    convexity: Convexity = field(default_factory=Convexity)
    noise: MeshNoise = field(default_factory=MeshNoise)
    density: DensityPrior = field(default_factory=DensityPrior)
    separation: Separation = field(default_factory=Separation)
    friction: float = 0.5
    """Coulomb friction of dry wood, plastic and ceramics on wood lies at 0.3 to 0.6."""
    trim: float = 2.0
    """Colliders of touching objects may be cut back by this many times the mesh's noise: hulls
    rest on the noise's peaks."""
    lowest_drop: float = 0.03
    """An object less than this share of its size above its support is lowered onto it; a
    placement is not more exact than that. One that hangs higher is left to fall."""
    most_shift: float = 0.05
    """Lifts, drops and pushes over this share of an object's size make it degraded."""


@dataclass(frozen=True)
class Simulation:
    """How long is simulated, and what still counts as having stood still."""

    seconds: float = 10.0
    frames_per_second: float = 50.0
    most_tilt_deg: float = 3.0
    most_drift: float = 0.02
    """Largest drift of the centre of mass relative to the body's longest extent."""
    rest_window_s: float = 1.0
    rest_drift_m: float = 5e-4
    rest_turn_deg: float = 0.1
    """A body is at rest if over the last window it moved and turned less than this."""

    def __post_init__(self) -> None:
        """Refuse a simulation without frames."""
        if self.seconds <= 0 or not 0 < self.frames_per_second <= 1 / TIMESTEP:
            raise ValueError(
                f"seconds must be > 0 and frames_per_second in 0..{1 / TIMESTEP:.0f}, got "
                f"{self.seconds} and {self.frames_per_second}"
            )
