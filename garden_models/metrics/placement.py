"""Measure how far a placed object is from where it truly stands.

Errors of position are shares of the object's size (diagonal of its bounding box).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from garden_models.geometry.rotation import yaw_gv
from garden_models.metrics.mesh import bounding_diagonal, sample_surface

SAMPLES = 4000
STEPS = 40


@dataclass(frozen=True)
class PlacementError:
    """``translation`` (share of the size), ``yaw_deg`` (0..180), ``tilt_deg`` between the
    vertical axes, and ``scale`` = estimated over true size.
    """

    translation: float
    yaw_deg: float
    tilt_deg: float
    scale: float


def yaw_difference_deg(estimated_rad: float, true_rad: float, symmetry: int | None = 1) -> float:
    """Return the difference of two headings in degrees.

    ``symmetry`` is the number of headings that look the same: 1 for none, 2 if half a turn
    changes nothing, and so on; None for a body of revolution (the difference is then 0).
    """
    if symmetry is None:
        return 0.0
    turn = 2.0 * np.pi / symmetry
    difference = (estimated_rad - true_rad) % turn
    return float(np.degrees(min(difference, turn - difference)))


def pose_error(
    gv_from_object: Float[np.ndarray, "4 4"],
    true_gv_from_object: Float[np.ndarray, "4 4"],
    centre_object: Float[np.ndarray, "3"],
    size: float,
    symmetry: int | None = 1,
) -> PlacementError:
    """Compare two poses of one mesh; position is compared at ``centre_object``.

    ``size`` is the true object's size in metres.
    """
    scale, rotation = _split(gv_from_object)
    true_scale, true_rotation = _split(true_gv_from_object)
    ours = gv_from_object[:3, :3] @ centre_object + gv_from_object[:3, 3]
    true = true_gv_from_object[:3, :3] @ centre_object + true_gv_from_object[:3, 3]
    relative = rotation @ true_rotation.T
    tilt = np.arccos(np.clip(relative[1, 1], -1.0, 1.0))
    yaw = np.arctan2(relative[0, 2] - relative[2, 0], relative[0, 0] + relative[2, 2])
    return PlacementError(
        float(np.linalg.norm(ours - true)) / size,
        yaw_difference_deg(float(yaw), 0.0, symmetry),
        float(np.degrees(tilt)),
        scale / true_scale,
    )


def shape_error(
    vertices_gv: Float[np.ndarray, "v 3"],
    faces: Int[np.ndarray, "f 3"],
    true_vertices_gv: Float[np.ndarray, "w 3"],
    true_faces: Int[np.ndarray, "g 3"],
    symmetry: int | None = 1,
    most_yaw_deg: float = 30.0,
    seed: int = 0,
) -> PlacementError:
    """Compare two placed meshes of one object that have different object frames.

    The error is the upright motion (translation and yaw) that registers the placed mesh to
    the true one best (symmetric closest points, started at headings up to
    ``most_yaw_deg`` apart). Position is compared at the centre of the true bounding box.
    """
    size = bounding_diagonal(true_vertices_gv)
    ours = sample_surface(vertices_gv, faces, SAMPLES, seed)
    true = sample_surface(true_vertices_gv, true_faces, SAMPLES, seed + 1)
    centre = 0.5 * (true_vertices_gv.min(axis=0) + true_vertices_gv.max(axis=0))
    starts = np.radians(np.linspace(-most_yaw_deg, most_yaw_deg, 5))
    fits = [_register(ours - centre, true - centre, float(yaw)) for yaw in starts]
    yaw, shift, _ = min(fits, key=lambda fit: fit[2])
    if symmetry is None:
        # Any turn is as good as none: what remains is the offset of the centres.
        shift = _register(ours - centre, true - centre, 0.0, turn=False)[1]
    return PlacementError(
        float(np.linalg.norm(shift)) / size,
        yaw_difference_deg(yaw, 0.0, symmetry),
        0.0,
        bounding_diagonal(vertices_gv) / size,
    )


def _register(
    ours: Float[np.ndarray, "n 3"],
    true: Float[np.ndarray, "m 3"],
    yaw: float,
    *,
    turn: bool = True,
) -> tuple[float, Float[np.ndarray, "3"], float]:
    """Return yaw, translation and rest of ``ours -> true`` about the origin."""
    tree = cKDTree(true)
    shift = np.zeros(3)
    rest = np.inf
    for _ in range(STEPS):
        moved = ours @ yaw_gv(yaw).T + shift
        to_true, index = tree.query(moved)
        to_ours, back = cKDTree(moved).query(true)
        source = np.concatenate([ours, ours[back]])
        target = np.concatenate([true[index], true])
        distance = np.concatenate([to_true, to_ours])
        rest = float(distance.mean())
        near = distance <= np.quantile(distance, 0.95)
        a, b = source[near], target[near]
        mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
        a, b = a - mean_a, b - mean_b
        if turn:
            sine = float((b[:, 0] * a[:, 2] - b[:, 2] * a[:, 0]).sum())
            yaw = float(np.arctan2(sine, (b[:, 0] * a[:, 0] + b[:, 2] * a[:, 2]).sum()))
        shift = mean_b - yaw_gv(yaw) @ mean_a
    return yaw, shift, rest


def _split(
    similarity: Float[np.ndarray, "4 4"],
) -> tuple[float, Float[np.ndarray, "3 3"]]:
    scale = float(np.cbrt(np.linalg.det(similarity[:3, :3])))
    return scale, similarity[:3, :3] / scale
