"""Baseline: a Manhattan frame from per-view vanishing points, as COLMAP's aligner finds it.

In each photo the nearly upright and nearly level segments give one vanishing point each by
RANSAC; the axes agreed on by most photos form the frame. It takes every photo to be upright.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.gravity.vanishing_points import all_segments
from garden_models.scene import GravityEvidence, Reconstruction

MIN_LENGTH_PX = 3.0
ORIENTATION_TOLERANCE = 0.2
MAX_DISTANCE_PX = 0.5
MAX_AXIS_DISTANCE = 0.05
TRIALS = 500
NOMINAL_SIGMA_DEG = 3.0
"""The method states no uncertainty; this is what it is worth where it works."""

Points = Float[np.ndarray, "n 3"]


def vanishing_point(segments: Float[np.ndarray, "n 4"], seed: int) -> Float[np.ndarray, "3"] | None:
    """Return the homogeneous point most segments run through; None for fewer than two."""
    if len(segments) < 2:
        return None
    ones = np.ones((len(segments), 1))
    start, end = np.hstack([segments[:, :2], ones]), np.hstack([segments[:, 2:], ones])
    lines, middle = np.cross(start, end), (start + end) / 2
    pairs = np.random.default_rng(seed).integers(len(segments), size=(TRIALS, 2))
    points = np.cross(lines[pairs[:, 0]], lines[pairs[:, 1]])
    points = points[np.abs(points[:, 2]) > 1e-12]
    if not len(points):
        return None
    joining = np.cross(middle[None], points[:, None])
    distance = np.abs(np.einsum("tni,ni->tn", joining, end))
    distance /= np.maximum(np.linalg.norm(joining[..., :2], axis=2), 1e-12)
    inside = distance < MAX_DISTANCE_PX
    return points[int(np.argmax(inside.sum(1)))]


def consensus(axes: Points) -> Float[np.ndarray, "3"]:
    """Return the mean of the largest set of axes that lie near one of them."""
    near = 1 - axes @ axes.T <= MAX_AXIS_DISTANCE
    best = near[int(np.argmax(near.sum(1)))]
    mean = axes[best].mean(0)
    return mean / np.linalg.norm(mean)


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return the frame's downward axis; None where no photo has a vertical vanishing point."""
    across: list[Float[np.ndarray, "3"]] = []
    downward: list[Float[np.ndarray, "3"]] = []
    for index, view in enumerate(reconstruction.views):
        segments = all_segments(view.rgb)
        vectors = segments[:, 2:] - segments[:, :2]
        length = np.linalg.norm(vectors, axis=1)
        long = length >= MIN_LENGTH_PX
        segments, unit = segments[long], np.abs(vectors[long] / length[long, None])
        rotation, K = view.camera_from_world[:3, :3], view.K
        for axis, found in ((0, across), (1, downward)):
            point = vanishing_point(segments[unit[:, axis] + ORIENTATION_TOLERANCE > 1], index)
            if point is None:
                continue
            direction = rotation.T @ np.linalg.solve(K, point)
            direction /= np.linalg.norm(direction)
            # Down as the photo has it, and every level axis towards the first one.
            reference = rotation[1] if axis == 1 else (found[0] if found else direction)
            found.append(direction if direction @ reference >= 0 else -direction)
    if not downward:
        return None
    down = consensus(np.array(downward))
    if across:
        right = consensus(np.array(across))
        u, _, vt = np.linalg.svd(np.stack([right, down, np.cross(right, down)], axis=1))
        down = (u @ vt)[:, 1]
    note = f"vertical vanishing points of {len(downward)} photos"
    return GravityEvidence("manhattan_frame", down, NOMINAL_SIGMA_DEG, True, note)
