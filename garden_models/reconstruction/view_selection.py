"""Choose, for each photo, the photos to match it with and the depths to look at.

Both come from the sparse points: a good partner shares many of them under a triangulation
angle that is wide enough to measure depth (whose information grows with the angle squared)
and narrow enough to look alike. Points count until enough partners see them. Where features
matched too rarely to tell, points that merely fall inside both photos count a little.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.camera import camera_centre, inside_image, project
from garden_models.reconstruction.undistort import WorkingView
from garden_models.scene import SparseModel

BEST_ANGLE_DEG = 8.0
SIGMA_ABOVE_DEG = 10.0
MAX_ANGLE_DEG = 45.0  # beyond it patches no longer look alike
UNMATCHED_WORTH = 0.1  # of a matched point, for one that only falls inside both photos
ENOUGH_PARTNERS = 2.0  # a point seen well by this many chosen partners counts no more
MIN_SHARED_POINTS = 8


def visibility(sparse: SparseModel) -> Bool[np.ndarray, "cameras points"]:
    """Tell which camera's photo holds an observation of which sparse point."""
    seen = np.zeros((len(sparse.cameras), len(sparse.points_world)), dtype=bool)
    points = np.repeat(np.arange(len(sparse.points_world)), np.diff(sparse.track_start))
    seen[sparse.track_views, points] = True
    return seen


def angle_weight(angle_deg: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return how useful a triangulation angle is for matching (1 at the best angle)."""
    information = np.minimum(angle_deg / BEST_ANGLE_DEG, 1.0) ** 2
    excess = np.maximum(angle_deg - BEST_ANGLE_DEG, 0.0) / SIGMA_ABOVE_DEG
    return np.where(angle_deg < MAX_ANGLE_DEG, information * np.exp(-0.5 * excess**2), 0.0)


def pair_weights(
    reference: int,
    centres_world: Float[np.ndarray, "cameras 3"],
    points_world: Float[np.ndarray, "points 3"],
    seen: Bool[np.ndarray, "cameras points"],
    framed: Bool[np.ndarray, "cameras points"],
) -> Float[np.ndarray, "cameras points"]:
    """Return, for each other camera and point, the point's worth to that pairing.

    ``seen`` tells which photos hold an observation of a point, ``framed`` in which it falls
    inside the picture. Photos with too few points in common are worth nothing.
    """
    weights = np.zeros(seen.shape)
    rays = points_world - centres_world[reference]
    length = np.linalg.norm(rays, axis=1)
    for other in range(len(centres_world)):
        both = np.flatnonzero(seen[reference] & framed[other])
        if other == reference or len(both) < MIN_SHARED_POINTS:
            continue
        other_rays = points_world[both] - centres_world[other]
        other_length = np.linalg.norm(other_rays, axis=1)
        cosine = np.einsum("nc,nc->n", rays[both], other_rays) / (length[both] * other_length)
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        ratio = np.minimum(length[both] / other_length, other_length / length[both])
        worth = np.where(seen[other, both], 1.0, UNMATCHED_WORTH)
        weights[other, both] = angle_weight(angle) * ratio * worth
    return weights


def choose_partners(weights: Float[np.ndarray, "cameras points"], count: int) -> tuple[int, ...]:
    """Pick up to ``count`` partners greedily, best first, so that together they cover the
    photo's points rather than its best corner ``count`` times.
    """
    covered = np.zeros(weights.shape[1])
    chosen: list[int] = []
    while len(chosen) < count:
        gain = np.minimum(covered + weights, ENOUGH_PARTNERS).sum(axis=1) - np.sum(covered)
        gain += 0.2 * weights.sum(axis=1)  # once all are covered: simply the best
        gain[chosen] = 0.0
        best = int(np.argmax(gain))
        if gain[best] <= 0:
            break
        chosen.append(best)
        covered = np.minimum(covered + weights[best], ENOUGH_PARTNERS)
    return tuple(chosen)


def select_views(
    views: tuple[WorkingView, ...], sparse: SparseModel, count: int
) -> tuple[tuple[int, ...], ...]:
    """Return the partners of every view (in the order of ``sparse.cameras``), best first
    (none: empty).
    """
    seen = visibility(sparse)
    centres = np.array([camera_centre(view.camera_from_world) for view in views])
    framed = np.zeros_like(seen)
    for i, view in enumerate(views):
        pixels, _ = project(sparse.points_world, view.K, view.camera_from_world)
        framed[i] = inside_image(pixels, view.size)
    return tuple(
        choose_partners(pair_weights(i, centres, sparse.points_world, seen, framed), count)
        for i in range(len(views))
    )


def inverse_depth_range(
    view: WorkingView,
    points_world: Float[np.ndarray, "points 3"],
    seen: Bool[np.ndarray, " points"],
    margin: float,
) -> tuple[float, float] | None:
    """Return (far, near) inverse depths that hold the view's sparse points, widened.

    The near end is ``1 + margin`` times nearer than the nearest (but for 1 % outliers); the far end
    as much again further, since what lies behind the points is often bare wall.
    None if fewer than 5 points are seen.
    """
    _, own_depth = project(points_world[seen], view.K, view.camera_from_world)
    own_depth = own_depth[own_depth > 0]
    if len(own_depth) < 5:
        return None
    pixels, depth = project(points_world, view.K, view.camera_from_world)
    framed = depth[inside_image(pixels, view.size)]
    near = np.quantile(own_depth, 0.01) / (1 + margin)
    far = max(np.quantile(own_depth, 0.99), np.quantile(framed, 0.95)) * (1 + margin) ** 2
    return 1.0 / float(far), 1.0 / float(near)
