"""Refine an upright pose by Gauss-Newton on depth and silhouette residuals.

Every step renders the mesh, then moves it so that its visible surface meets the measured
depths (point to plane, Chen and Medioni 1992) and its rim meets the masks' outlines. The
rotation stays a turn about gravity (paper, section 3.2).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.meshing.ray_casting import Hits
from garden_models.placement.compare import HIDDEN_MARGIN, Comparison, RenderedView
from garden_models.placement.pose import UprightPose

FIRST_REACH = 0.25
LAST_REACH = 0.04
"""Residuals beyond this share of the size are ignored; it shrinks from step to step."""

FLATTEST = 0.15
"""Cosine between ray and surface below which a depth residual says nothing."""

DAMPING = 1e-3
"""Levenberg's damping relative to each unknown's own weight."""

YAW_SIGMA = 0.1
"""Turn (rad) that one step takes if nothing but noise asks for it: a body of revolution has
no heading that shape could show, and must not be spun by noise."""


def refine(
    comparison: Comparison, pose: UprightPose, steps: int, *, with_scale: bool = True
) -> UprightPose:
    """Return the pose after ``steps`` Gauss-Newton steps on yaw, translation and scale."""
    flags = np.array([True, True, True, True, with_scale])
    for reach in np.geomspace(FIRST_REACH, LAST_REACH, steps):
        step = _step(comparison, pose, float(reach) * comparison.size * pose.scale, flags)
        if step is None:
            break
        pose = pose.moved(step)
    return pose


def _step(
    comparison: Comparison, pose: UprightPose, reach: float, flags: Bool[np.ndarray, "5"]
) -> Float[np.ndarray, "5"] | None:
    """Return one Gauss-Newton step; None if nothing can be compared."""
    size = comparison.size * pose.scale
    hits, views = comparison.render(pose)
    depth_rows = [_depth_rows(comparison, pose, hits, view) for view in views]
    rim_rows = [_rim_rows(pose, view, size) for view in views]
    normal = np.zeros((5, 5))
    right = np.zeros(5)
    for rows in (depth_rows, rim_rows):
        jacobian = np.concatenate([row[0] for row in rows])
        residual = np.concatenate([row[1] for row in rows])
        near = np.abs(residual) < reach
        if near.sum() < 10:
            continue
        jacobian, residual = jacobian[near], residual[near]
        scale = max(1.4826 * float(np.median(np.abs(residual))), 2e-3 * size)
        weight = 1.0 / (1.0 + (residual / scale) ** 2) ** 2 / (len(residual) * scale**2)
        normal += jacobian.T @ (weight[:, None] * jacobian)
        right += jacobian.T @ (weight * residual)
    if not normal.any():
        return None
    normal[0, 0] += 1.0 / YAW_SIGMA**2
    normal, right = normal[np.ix_(flags, flags)], right[flags]
    normal[np.diag_indices_from(normal)] *= 1.0 + DAMPING
    step = np.zeros(5)
    step[flags] = np.linalg.lstsq(normal, right, rcond=None)[0]
    # No single step may leave the range in which the residuals were linearised.
    limit = np.array([0.35, reach, reach, reach, 0.2])
    return np.clip(step, -limit, limit)


def _motion(
    points_gv: Float[np.ndarray, "n 3"], along: Float[np.ndarray, "n 3"], pose: UprightPose
) -> Float[np.ndarray, "n 5"]:
    """Return how far points move ``along`` a direction per unit of each unknown."""
    arm = points_gv - pose.translation_gv
    # A turn about y (down) moves a point by y x arm = (arm_z, 0, -arm_x).
    turn = along[:, 0] * arm[:, 2] - along[:, 2] * arm[:, 0]
    return np.column_stack([turn, along, (along * arm).sum(axis=1)])


def _depth_rows(
    comparison: Comparison, pose: UprightPose, hits: Hits, view: RenderedView
) -> tuple[Float[np.ndarray, "k 5"], Float[np.ndarray, " k"]]:
    """Return Jacobian and residuals (metres) between measured points and seen surface."""
    pixels = view.pixels
    use = np.flatnonzero(view.hit & pixels.mask & (pixels.depth > 0))
    direction = pixels.directions_gv[use]
    origin = pixels.gv_from_camera[:3, 3]
    surface = origin + direction * view.depth[use, None]
    measured = origin + direction * pixels.depth[use, None]
    normal = comparison.face_normals[hits.face[view.part][use]] @ pose.rotation_gv.T
    cosine = np.abs((normal * direction).sum(axis=1)) / np.linalg.norm(direction, axis=1)
    keep = cosine > FLATTEST
    residual = (normal * (measured - surface)).sum(axis=1)
    return _motion(surface, normal, pose)[keep], residual[keep]


def _rim_rows(
    pose: UprightPose, view: RenderedView, size: float
) -> tuple[Float[np.ndarray, "k 5"], Float[np.ndarray, " k"]]:
    """Return Jacobian and residuals (metres) between the rendered rim and the outline.

    The rim runs on average half way between a pixel that is hit and a neighbour on the
    lattice that is not.
    """
    pixels = view.pixels
    use, missed = _rim(view)
    outward = 0.5 * (pixels.outward_px[use] + pixels.outward_px[missed])
    length = np.linalg.norm(outward, axis=1)
    depth = view.depth[use]
    # What hides the miss may hide more of the object: there the rim is not the outline.
    nearer = pixels.occluder_depth[missed] < depth - HIDDEN_MARGIN * size
    covered = ~pixels.mask[missed] & nearer
    keep = (length > 0.3) & ~view.hidden[use] & ~covered
    use, missed, depth = use[keep], missed[keep], depth[keep]
    outward = outward[keep] / length[keep, None]
    outside = 0.5 * (pixels.outside_px[use] + pixels.outside_px[missed])
    residual = -outside * depth / pixels.focal_px
    flat = np.column_stack([outward, np.zeros(len(use))])
    along = flat @ pixels.gv_from_camera[:3, :3].T
    places = pixels.gv_from_camera[:3, 3] + pixels.directions_gv[use] * depth[:, None]
    return _motion(places, along, pose), residual


def _rim(view: RenderedView) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"]]:
    """Return pairs of neighbouring lattice pixels of which the first is hit, the second not."""
    shape = view.pixels.shape
    index = np.arange(view.hit.size).reshape(shape)
    pairs = [(index[:-1].ravel(), index[1:].ravel())]
    pairs.append((index[:, :-1].ravel(), index[:, 1:].ravel()))
    first = np.concatenate([a for a, _ in pairs])
    second = np.concatenate([b for _, b in pairs])
    out, back = view.hit[first] & ~view.hit[second], ~view.hit[first] & view.hit[second]
    return np.concatenate([first[out], second[back]]), np.concatenate([second[out], first[back]])
