"""Check by the photos themselves that predicted depths have the scale of the cameras.

Depths of another scale may still agree with each other on flat walls, but then a point seen
in one photo does not look like what lies where another photo is said to see it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import inside_image, pixel_grid, project
from garden_models.reconstruction.undistort import WorkingView
from garden_models.reconstruction.view_alignment import lift_pixels
from garden_models.scene import OK, Verdict

FACTORS = np.exp(np.linspace(-0.6, 0.6, 13))
"""By what depths are multiplied to see whether photos match better so."""
SAMPLES = 1500
PARTNERS = 2
BLUR_PX = 2.0
MAX_OFF = 0.16
"""Factors this near to 1 are its neighbours in ``FACTORS``: no contradiction."""
CLEARLY = 0.8
"""Photos must differ by less than this share of what they differ by at factor 1."""


def judge_depth_scale(
    views: Sequence[WorkingView],
    depths: Sequence[Float[np.ndarray, "h w"]],
    partners: Mapping[int, Sequence[int]],
) -> Verdict:
    """Return a degraded verdict if photos clearly match better with other depths.

    ``depths`` (0 where there is none) are of the views and in the unit of their cameras.
    """
    luma = [_luma(view) for view in views]
    costs = [
        _costs(views[i], depths[i], luma[i], views[j], luma[j])
        for i, others in partners.items()
        for j in others[:PARTNERS]
    ]
    known = [cost for cost in costs if np.isfinite(cost).all()]
    if not known:
        return OK
    cost = np.median(known, axis=0)
    best, at_one = int(np.argmin(cost)), len(FACTORS) // 2
    if abs(np.log(FACTORS[best])) < MAX_OFF or cost[best] > CLEARLY * cost[at_one]:
        return OK
    return Verdict(
        "degraded",
        (
            f"photos match best if the depths are multiplied by {FACTORS[best]:.2f}: depths and "
            "cameras are not of the same scale",
        ),
    )


def _luma(view: WorkingView) -> Float[np.ndarray, "h w"]:
    grey = cv2.cvtColor(view.rgb, cv2.COLOR_RGB2GRAY).astype(np.float32)
    blurred: np.ndarray = cv2.GaussianBlur(grey, (0, 0), BLUR_PX)
    return blurred


def _costs(
    view: WorkingView,
    depth: Float[np.ndarray, "h w"],
    own: Float[np.ndarray, "h w"],
    other: WorkingView,
    theirs: Float[np.ndarray, "h w"],
) -> Float[np.ndarray, " factors"]:
    """Return how much two photos differ where one sees the other's points, by factor.

    The same points count at every factor: those that are always inside the other photo.
    """
    rows, columns = np.nonzero(depth > 0)
    every = max(1, len(rows) // SAMPLES)
    rows, columns = rows[::every], columns[::every]
    pixels = pixel_grid(*depth.shape)[rows, columns]
    z = depth[rows, columns].astype(np.float64)
    places, always = [], np.ones(len(z), bool)
    for factor in FACTORS:
        world = lift_pixels(pixels, factor * z, view.K, view.camera_from_world)
        seen, _ = project(world, other.K, other.camera_from_world)
        always &= inside_image(seen, other.size)
        places.append(seen)
    if always.sum() < SAMPLES // 20:
        return np.full(len(FACTORS), np.inf)
    difference = []
    for place in places:
        x, y = (place[always] - 0.5).astype(np.float32).T
        there = cv2.remap(theirs, x[None], y[None], cv2.INTER_LINEAR)[0]
        error = own[rows[always], columns[always]] - there
        difference.append(float(np.median(np.abs(error - np.median(error)))))
    return np.array(difference)
