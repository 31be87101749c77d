"""Bring a prediction into the world of the cameras that were given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from garden_models.geometry.camera import camera_centre
from garden_models.geometry.rotation import rotation_angle_deg
from garden_models.reconstruction.geometry_model import GeometryRequest, GeometryView
from garden_models.reconstruction.photo_framing import Framing
from garden_models.scene import OK, BadInput, Verdict

MAX_TURN_DEG = 10.0
"""Median difference between predicted and given turns from photo to photo from which on the
given cameras are doubted."""
MAX_SPREAD = 0.2
"""The same for the relative spread of distances between cameras."""

Cameras = Float[np.ndarray, "n r 4"]


@dataclass(frozen=True)
class InGivenWorld:
    """Views with the given cameras; depths were multiplied by ``factor``."""

    views: tuple[GeometryView, ...]
    factor: float
    verdict: Verdict


def in_given_world(
    views: Sequence[GeometryView],
    request: GeometryRequest,
    framings: Sequence[Framing],
    metric: bool,
) -> InGivenWorld:
    """Replace predicted cameras by the given ones and bring depths to their unit.

    The unit is the median over pairs of photos of how far apart they are given and predicted.
    Raises BadInput where all given cameras stand in one place and the model knows no metres.
    """
    assert request.camera_from_world is not None and request.K is not None
    given = request.camera_from_world
    predicted = np.stack([view.camera_from_world for view in views])
    factor = unit_factor(predicted, given)
    if factor is None and not metric:
        raise BadInput(
            "the given cameras all stand in one place, so that nothing tells the size of what "
            "this model predicts: give cameras that stand apart, or use a metric model"
        )
    factor = 1.0 if factor is None else factor
    moved = tuple(
        replace(
            view,
            depth=view.depth * np.float32(factor),
            K=framing.whole_intrinsics(framing.model_intrinsics(K)),
            camera_from_world=np.asarray(pose[:3], np.float64),
        )
        for view, framing, K, pose in zip(views, framings, request.K, given, strict=True)
    )
    return InGivenWorld(moved, factor, judge_given(predicted, given))


def _distances(cameras: Cameras) -> Float[np.ndarray, " pairs"]:
    centres = np.stack([camera_centre(camera) for camera in cameras])
    first, second = np.triu_indices(len(centres), 1)
    return np.linalg.norm(centres[first] - centres[second], axis=1)


def unit_factor(predicted: Cameras, given: Cameras) -> float | None:
    """Return how many given units one predicted unit is; None if no cameras stand apart.

    Pairs count by their given distance, so that near ones, which noise decides, say little.
    """
    near, far = _distances(predicted), _distances(given)
    apart = (near > 1e-9) & (far > 1e-9)
    if not apart.any():
        return None
    return weighted_median(far[apart] / near[apart], far[apart])


def weighted_median(values: Float[np.ndarray, " n"], weights: Float[np.ndarray, " n"]) -> float:
    """Return the value at which half of the weight lies below."""
    order = np.argsort(values)
    heap = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(heap, heap[-1] / 2)])


def judge_given(predicted: Cameras, given: Cameras) -> Verdict:
    """Return a degraded verdict if photos turn or move otherwise than the given cameras say."""
    turns = [
        rotation_angle_deg(p[:, :3] @ q[:, :3].T @ (g[:3, :3] @ h[:3, :3].T).T)
        for p, q, g, h in zip(predicted[1:], predicted[:-1], given[1:], given[:-1], strict=True)
    ]
    reasons = []
    if turns and np.median(turns) > MAX_TURN_DEG:
        reasons.append(
            f"from photo to photo the given cameras turn otherwise than predicted (by "
            f"{np.median(turns):.0f} degrees): check that they belong to these photos and are "
            "what their file's format says"
        )
    factor = unit_factor(predicted, given)
    if factor is not None and len(given) > 2:
        near, far = _distances(predicted) * factor, _distances(given)
        spread = float(np.median(np.abs(near - far)) / max(np.median(far), 1e-12))
        if spread > MAX_SPREAD:
            reasons.append(
                f"the given cameras stand apart otherwise than predicted (by {spread:.0%})"
            )
    return Verdict("degraded", tuple(reasons)) if reasons else OK
