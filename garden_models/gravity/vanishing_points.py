"""Vanishing points of all views together: upright edges point along gravity.

A line segment and the camera centre span a plane; its normal ``m``, turned into the world,
is perpendicular to the segment's 3D direction whichever view saw it. So the segments of all
views vote together on one sphere of directions, without any view's own vanishing point.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8

from garden_models.geometry.camera import pixel_rays
from garden_models.geometry.direction import (
    Form,
    add_covariance,
    axis_angle_deg,
    hemisphere,
    least_axis,
)
from garden_models.gravity import camera_x_axes
from garden_models.gravity.protocol import Cue, Mode
from garden_models.scene import GravityEvidence, Reconstruction

Votes = Float[np.ndarray, "axes segments"]

METHOD = "vanishing_points"

MIN_LENGTH = 0.03
"""Shortest segment, as a share of the picture's diagonal."""
MAX_SEGMENTS = 300
"""Segments kept in a view, the longest first."""
ENDPOINT_PX = 0.7
STRUCTURE = np.radians(0.5)
"""How far from parallel built edges are, with what is left of lens distortion."""
VOTE_SIGMA = np.radians(1.5)
GRID = 5000
MAX_VOTERS = 5000
MAX_SIGMA = np.radians(10.0)
MODES = 6
MIN_SUPPORT = 12
"""Fewest segments that make a direction worth naming."""
SAME_DEG = 3.0
MIN_EXCESS = 0.02
"""Least share of all segments, beyond chance, of a direction worth naming."""
STRONG_EXCESS = 0.1
"""Share from which a direction is surely built; more makes it no likelier to be upright."""
FOCAL_ERROR: dict[str, float] = {"estimated": 0.01, "known": 0.02}
"""Relative error of the focal length: it tilts a vanishing point in all views alike."""
REPEATS = 4.0
"""The same edge is seen in about this many views: segments are not independent."""


@dataclass(frozen=True)
class Segments:
    """Segments of all views: unit plane normals in the world, their error and weight."""

    normals_world: Float[np.ndarray, "n 3"]
    sigma_rad: Float[np.ndarray, " n"]
    weight: Float[np.ndarray, " n"]
    view: Int[np.ndarray, " n"]


def all_segments(rgb: UInt8[np.ndarray, "h w 3"]) -> Float[np.ndarray, "n 4"]:
    """Return the picture's line segments (x0, y0, x1, y1), pixel centres at +0.5 (LSD)."""
    grey = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
    lines = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    if lines is None:
        return np.zeros((0, 4))
    return lines.reshape(-1, 4).astype(np.float64) + 0.5


def long_segments(rgb: UInt8[np.ndarray, "h w 3"]) -> Float[np.ndarray, "n 4"]:
    """Return the picture's longest line segments."""
    segments = all_segments(rgb)
    length = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    long = length > MIN_LENGTH * np.hypot(*rgb.shape[:2])
    order = np.argsort(-length[long], kind="stable")[:MAX_SEGMENTS]
    return segments[long][order]


def lift(
    segments: Float[np.ndarray, "n 4"],
    K: Float[np.ndarray, "3 3"],
    rotation: Float[np.ndarray, "3 3"],
    size: tuple[int, int],
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return the plane normals in the world of a picture's segments, their sigmas and weights.

    ``rotation`` is camera from world, ``size`` the picture's width and height in pixels.
    """
    first, second = (pixel_rays(segments[:, s], K) for s in (slice(0, 2), slice(2, 4)))
    normal = np.cross(first, second)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    length = np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1])
    sigma = np.hypot(np.sqrt(2) * ENDPOINT_PX / length, STRUCTURE)
    weight = np.minimum(length / np.hypot(*size), 0.2) / 0.2
    return normal @ rotation, sigma, weight


def lift_segments(reconstruction: Reconstruction) -> Segments:
    """Detect the segments of every view and lift them to plane normals in the world."""
    normals: list[np.ndarray] = []
    sigmas: list[np.ndarray] = []
    weights: list[np.ndarray] = []
    views: list[np.ndarray] = []
    for index, view in enumerate(reconstruction.views):
        segments = long_segments(view.rgb)
        if not len(segments):
            continue
        lifted = lift(segments, view.K, view.camera_from_world[:3, :3], view.size)
        for whole, part in zip((normals, sigmas, weights), lifted, strict=True):
            whole.append(part)
        views.append(np.full(len(segments), index))
    if not normals:
        return Segments(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0, dtype=int))
    return Segments(*(np.concatenate(part) for part in (normals, sigmas, weights, views)))


def vote_kernel(segments: Segments, axes: Float[np.ndarray, "n 3"]) -> Votes:
    """Return how well each segment points along each axis, 0..1."""
    sigma = np.maximum(segments.sigma_rad, VOTE_SIGMA)
    scaled = (segments.normals_world / sigma[:, None]).astype(np.float32)
    residual = axes.astype(np.float32) @ scaled.T
    return np.exp(-0.5 * residual * residual)


def refine(
    segments: Segments, start: Float[np.ndarray, "3"]
) -> tuple[Form, Float[np.ndarray, " n"]]:
    """Return the form of the vanishing direction near ``start`` and each segment's share in it."""
    axis = start
    for step in range(12):
        # The gate closes from the vote's width to each segment's own error.
        sigma = np.maximum(segments.sigma_rad, VOTE_SIGMA * max(0.0, 1 - step / 6))
        residual = segments.normals_world @ axis / sigma
        share = 1 / (1 + (residual / 2) ** 4)
        weight = segments.weight * share / sigma**2 / REPEATS
        form = (segments.normals_world * weight[:, None]).T @ segments.normals_world
        axis = least_axis(form)[0]
    return form, share


def focal_tilt(
    rotations: Float[np.ndarray, "views 3 3"], axis: Float[np.ndarray, "3"], error: float
) -> Form:
    """Return the covariance (rad^2) that a common focal error gives a direction.

    A focal length ``1 + error`` too long shrinks a direction's x and y in the camera.
    """
    in_camera = rotations @ axis
    moved = -error * in_camera * np.array([1.0, 1.0, 0.0])
    world = np.einsum("vij,vi->vj", rotations, moved).mean(0)
    tilt = world - axis * (axis @ world)
    return np.outer(tilt, tilt)


def strongest(segments: Segments, count: int) -> Segments:
    """Return the ``count`` heaviest segments."""
    keep = np.sort(np.argsort(-segments.weight, kind="stable")[:count])
    return Segments(*(getattr(segments, f.name)[keep] for f in fields(Segments)))


def read(reconstruction: Reconstruction) -> Cue | None:
    """Return the vanishing directions of all views; None where segments are too few."""
    segments = lift_segments(reconstruction)
    if len(segments.weight) < MIN_SUPPORT:
        return None
    grid = hemisphere(GRID)
    voters = strongest(segments, MAX_VOTERS)
    kernel = vote_kernel(voters, grid)
    left = voters.weight.astype(np.float32)
    readings: list[tuple[Form, float, str]] = []
    for _ in range(MODES):
        scores = kernel @ left
        form, share = refine(segments, grid[int(np.argmax(scores))])
        axis, sigmas, _ = least_axis(form)
        near = vote_kernel(voters, axis[None])[0]
        # What the segments that are left give this direction beyond what they give any.
        excess = float(near @ left - np.median(scores)) / float(voters.weight.sum())
        support = share > 0.5
        # A segment belongs to one edge: those that are explained vote no more.
        left = left * (1 - near)
        known = [least_axis(other)[0] for other, _, _ in readings]
        again = any(axis_angle_deg(axis, other) < SAME_DEG for other in known)
        if again or support.sum() < MIN_SUPPORT or sigmas[0] > MAX_SIGMA or excess < MIN_EXCESS:
            continue
        views = len(np.unique(segments.view[support]))
        readings.append((form, excess, f"{support.sum()} segments in {views} views"))
    rotations = np.array([v.camera_from_world[:3, :3] for v in reconstruction.views])
    error = FOCAL_ERROR[reconstruction.cameras_source]
    heaviness = [min(excess, STRONG_EXCESS) for _, excess, _ in readings]
    total = sum(heaviness) + STRONG_EXCESS
    modes = tuple(
        Mode(
            add_covariance(
                form,
                STRUCTURE**2 * np.eye(3) + focal_tilt(rotations, least_axis(form)[0], error),
            ),
            heavy / total,
            words,
        )
        for (form, _, words), heavy in zip(readings, heaviness, strict=True)
    )
    if not modes:
        return None
    axes = tuple(mode.axis for mode in modes)
    return Cue(METHOD, modes, claims_vertical=False, directions=axes)


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return gravity from vanishing points; the cameras' habit tells which one is upright."""
    cue = read(reconstruction)
    return None if cue is None else cue.alone(camera_x_axes.read(reconstruction))
