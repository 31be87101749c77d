"""Align two predictions of the same photos by a similarity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import camera_centre, pixel_grid, pixel_rays
from garden_models.geometry.rigid import invert_rigid, transform_points
from garden_models.reconstruction.geometry_model import GeometryView
from garden_models.reconstruction.given_cameras import weighted_median
from garden_models.reconstruction.similarity import Similarity
from garden_models.scene import BadGeometry

SAMPLES = 900
"""Pixels of each shared photo that are compared."""
FEWEST = 30
"""Pixels that must be known in both predictions."""
ROUNDS = 20
LEAST_ERROR = 1e-6


@dataclass(frozen=True)
class Joint:
    """World b from world a, and how well it fits: the median distance between where the two
    predictions see the same pixels, as a share of their depth.
    """

    b_from_a: Similarity
    misfit: float


@dataclass(frozen=True)
class Matches:
    """The same pixels in two worlds. ``depth_a`` and ``depth_b`` are their z-depths."""

    points_a: Float[np.ndarray, "n 3"]
    points_b: Float[np.ndarray, "n 3"]
    depth_a: Float[np.ndarray, " n"]
    depth_b: Float[np.ndarray, " n"]
    weight: Float[np.ndarray, " n"]


def align_views(views_a: Sequence[GeometryView], views_b: Sequence[GeometryView]) -> Joint:
    """Return world b from world a, of which both sequences show the same photos in order.

    The scale starts from the ratios of depths, the rotation from the cameras' turns, the shift
    from their centres, each by a median; then the points themselves are fitted, those that
    miss counting less and less (Cauchy). Raises BadGeometry if too few pixels are known in
    both.
    """
    matches = match_pixels(views_a, views_b)
    if len(matches.weight) < FEWEST:
        raise BadGeometry(
            "two chunks of the photos share too few pixels with a known depth to be joined: take "
            "photos that overlap more, or state more GPU memory so that chunks are longer"
        )
    found = _start(views_a, views_b, matches)
    for _ in range(ROUNDS):
        error = _errors(found, matches)
        spread = max(weighted_median(error, matches.weight), LEAST_ERROR)
        trust = matches.weight / (1 + (error / spread) ** 2) / matches.depth_b**2
        found = weighted_similarity(matches.points_a, matches.points_b, trust)
    return Joint(found, weighted_median(_errors(found, matches), matches.weight))


def _errors(b_from_a: Similarity, matches: Matches) -> Float[np.ndarray, " n"]:
    missed = b_from_a.points(matches.points_a) - matches.points_b
    found: np.ndarray = np.linalg.norm(missed, axis=1) / matches.depth_b
    return found


def match_pixels(views_a: Sequence[GeometryView], views_b: Sequence[GeometryView]) -> Matches:
    """Return pixels of shared photos that have a depth in both predictions.

    The photos may have been cut differently: pixels are matched by where they lie in the photo.
    """
    parts = [_match(a, b) for a, b in zip(views_a, views_b, strict=True)]
    return Matches(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("points_a", "points_b", "depth_a", "depth_b", "weight")
        )
    )


def _match(a: GeometryView, b: GeometryView) -> Matches:
    if a.depth.shape != b.depth.shape:
        raise BadGeometry("two chunks show a photo at different sizes")
    height, width = a.depth.shape
    step = max(1, int((height * width / SAMPLES) ** 0.5))
    rows, columns = np.mgrid[step // 2 : height : step, step // 2 : width : step]
    known = (a.depth[rows, columns] > 0) & (b.depth[rows, columns] > 0)
    rows, columns = rows[known], columns[known]
    depth_a = a.depth[rows, columns].astype(np.float64)
    depth_b = b.depth[rows, columns].astype(np.float64)
    pixels = pixel_grid(height, width)[rows, columns]
    return Matches(
        lift(pixels, depth_a, a),
        lift(pixels, depth_b, b),
        depth_a,
        depth_b,
        np.minimum(a.confidence[rows, columns], b.confidence[rows, columns]).astype(np.float64)
        + 1e-6,
    )


def lift(
    pixels: Float[np.ndarray, "n 2"], depth: Float[np.ndarray, " n"], view: GeometryView
) -> Float[np.ndarray, "n 3"]:
    """Return the world points at some pixels of a view."""
    return lift_pixels(pixels, depth, view.K, view.camera_from_world)


def lift_pixels(
    pixels: Float[np.ndarray, "n 2"],
    depth: Float[np.ndarray, " n"],
    K: Float[np.ndarray, "3 3"],
    camera_from_world: Float[np.ndarray, "r 4"],
) -> Float[np.ndarray, "n 3"]:
    """Return the world points at some pixels, of these z-depths."""
    return transform_points(invert_rigid(camera_from_world), pixel_rays(pixels, K) * depth[:, None])


def _start(
    views_a: Sequence[GeometryView], views_b: Sequence[GeometryView], matches: Matches
) -> Similarity:
    scale = float(
        np.exp(weighted_median(np.log(matches.depth_b / matches.depth_a), matches.weight))
    )
    turns = np.stack(
        [
            b.camera_from_world[:, :3].T @ a.camera_from_world[:, :3]
            for a, b in zip(views_a, views_b, strict=True)
        ]
    )
    rotation = middle_rotation(turns)
    shifts = np.stack(
        [
            camera_centre(b.camera_from_world)
            - scale * rotation @ camera_centre(a.camera_from_world)
            for a, b in zip(views_a, views_b, strict=True)
        ]
    )
    return Similarity(scale, rotation, np.median(shifts, axis=0))


def middle_rotation(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation with the least sum of distances to the given ones (of theirs)."""
    distance = np.linalg.norm(rotations[:, None] - rotations[None], axis=(2, 3)).sum(axis=1)
    chosen: np.ndarray = rotations[int(np.argmin(distance))]
    return chosen


def weighted_similarity(
    points_a: Float[np.ndarray, "n 3"],
    points_b: Float[np.ndarray, "n 3"],
    weight: Float[np.ndarray, " n"],
) -> Similarity:
    """Return the weighted least-squares similarity (Umeyama 1991), its scale symmetric (Horn
    1987): noise in either set must not shrink what is joined, chunk after chunk.
    """
    share = weight / weight.sum()
    mean_a, mean_b = share @ points_a, share @ points_b
    a, b = points_a - mean_a, points_b - mean_b
    u, _, vt = np.linalg.svd((share[:, None] * b).T @ a)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = (u * sign) @ vt
    scale = float(((share @ (b**2).sum(1)) / max(share @ (a**2).sum(1), 1e-300)) ** 0.5)
    return Similarity(scale, rotation, mean_b - scale * rotation @ mean_a)
