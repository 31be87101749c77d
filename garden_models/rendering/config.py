"""Hold the settings of rendering."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Splatting:
    """How points are drawn; lengths are relative to each point's own spacing."""

    radius: float = 1.15
    """Disc radius in spacings: discs of a surface sampled at that spacing, if not perfectly
    evenly, leave no hole. Rims hardly count where discs overlap."""
    least_radius_px: float = 0.71
    """Half a pixel's diagonal: a far point covers at least the pixel that it falls in."""
    most_radius: float = 0.08
    """Largest disc radius relative to the picture's width (points right before the lens)."""
    blend_depth: float = 1.5
    """Discs that lie behind the nearest by less than this many spacings are of one surface."""
    pinhole_px: int = 2
    """Distance in pixels at which a pinhole looks for the surface around it; 0: leave them."""
    near: float = 1e-3
    """Least visible z-depth in metres."""

    def __post_init__(self) -> None:
        """Refuse sizes that draw nothing."""
        if self.radius <= 0 or self.least_radius_px < 0.5:
            raise ValueError(
                f"radius must be > 0 and least_radius_px >= 0.5, got {self.radius} "
                f"and {self.least_radius_px}"
            )


NEUTRAL = (128, 128, 128)
"""Colour of pixels where neither a mesh nor a point is seen: mid-grey, the value that is
nearest to everything, so that it neither flatters nor ruins a comparison with a photo."""


@dataclass(frozen=True)
class Drawing:
    """How a picture is drawn."""

    splatting: Splatting = field(default_factory=Splatting)
    neutral: tuple[int, int, int] = NEUTRAL
    smoothing: int = 2
    """Meshes are drawn this many times finer and averaged, so that their outlines are even."""


@dataclass(frozen=True)
class RenderViews:
    """Which photos are rendered, and how."""

    most_views: int = 8
    drawing: Drawing = field(default_factory=Drawing)
