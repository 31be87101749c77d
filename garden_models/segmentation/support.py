"""Name the support surface that carries an object, at its height under the object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.outline import Grid, inside_polygon, outer_polygon, signed_area
from garden_models.physics.support_surfaces import find_support_surfaces
from garden_models.scene import PointCloud, SupportSurface
from garden_models.segmentation.carrier import Carrier

SAME_SURFACE = 3.0
"""A surface of the room within this many bands of the local height is the one below."""


def support_of(
    name: str,
    carrier: Carrier,
    nodes: PointCloud,
    points_gv: PointCloud,
    camera_centres_gv: Float[np.ndarray, "c 3"],
) -> SupportSurface:
    """Return the room's surface under the object, its height refined at the object's foot.

    Where the room has no surface there at that height, it is a patch made of the points
    around the foot.
    """
    foot = carrier.foot_xz
    height = carrier.plane.height + float(carrier.plane.slope @ foot)
    fitting = [
        surface
        for surface in find_support_surfaces(points_gv, camera_centres_gv)
        if abs(surface.height_gv - height) <= SAME_SURFACE * carrier.band
        and inside_polygon(foot[None], surface.outline_gv)[0]
    ]
    if fitting:
        nearest = min(fitting, key=lambda surface: abs(surface.height_gv - height))
        return replace(nearest, height_gv=height)
    own = nodes.xyz[carrier.inliers][:, [0, 2]]
    grid = Grid.around(own, 3 * float(np.median(nodes.spacing)), margin=2)
    outline = outer_polygon(grid.count(own) > 0, grid)
    return SupportSurface(
        f"under_{name}", "patch", height, outline, abs(signed_area(outline)), len(own)
    )
