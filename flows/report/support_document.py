"""Write a support surface into the report, its outline with no more vertices than it needs."""

from __future__ import annotations

from typing import Any

import numpy as np

from garden_models.geometry.simplify import simplify_polygon
from garden_models.scene import SupportSurface

TOLERANCE = 0.02
"""How far the written outline may be off, relative to the square root of the area."""

MOST_AREA_CHANGE = 0.02
"""Share of the area by which the written outline's may differ."""


def support_document(support: SupportSurface) -> dict[str, Any]:
    """Return the surface as JSON; the outline's tolerance is stated with it."""
    wished = TOLERANCE * float(np.sqrt(max(support.area_m2, 0.0)))
    outline, tolerance = simplify_polygon(support.outline_gv, wished, MOST_AREA_CHANGE)
    return {
        "name": support.name,
        "kind": support.kind,
        "height_gv": float(f"{support.height_gv:.6g}"),
        "area_m2": float(f"{support.area_m2:.6g}"),
        "outline_gv": np.round(outline, 4).tolist(),
        "outline_tolerance_m": float(f"{tolerance:.3g}"),
    }
