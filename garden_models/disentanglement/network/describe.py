"""Turn a cloud and a condition into what the network reads.

Lengths are relative to the condition's longest extent and its box's centre. The network looks
at a fixed context, chosen from the cloud by place alone; every other point is only asked
about, so that what is said of one point does not depend on which others are asked with it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from garden_models.disentanglement.network.condition_distance import Surface
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.surroundings import (
    FINE,
    LAYER_SHARE,
    LEVEL,
    LINK,
    cluster_features,
    clusters,
    layer_density,
    local_shape,
    neighbours,
    strongest_layer,
)
from garden_models.disentanglement.training.pair import Condition
from garden_models.disentanglement.triangles import normals

OWN = 18
"""Features of a point by itself: place, how it lies to the condition, place in the crop."""
AROUND = 21
"""Features that a point has from the nearest context point."""
OBJECT = 8
"""Features of a condition sample."""
NEAR = 0.15
"""Of the object's size: how near to the condition a cluster's points count as near."""
LEAST_DISTANCE = 1e-3
EDGE = 0.005
"""Share of the context beyond the crop's bounds on each side: strays do not move them."""


@dataclass(frozen=True)
class Frame:
    """Where coordinates are relative to: the condition's centre, and its size (metres)."""

    centre: Float[np.ndarray, "3"]
    size: float

    def relative(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return points relative to the frame."""
        return np.asarray((points - self.centre) / self.size)


@dataclass(frozen=True)
class Context:
    """What the network looks at: context points with features, tokens among them, condition.

    ``bounds`` are the crop's corners in metres. ``token`` holds indices of context points,
    ``assigned`` each context point's token.
    """

    frame: Frame
    surface: Surface
    bounds: Float[np.ndarray, "2 3"]
    points: Float[np.ndarray, "c 3"]
    around: Float[np.ndarray, "c a"]
    features: Float[np.ndarray, "c f"]
    token: Int[np.ndarray, " m"]
    assigned: Int[np.ndarray, " c"]
    condition: Float[np.ndarray, "k g"]


def describe_context(
    points: Float[np.ndarray, "c 3"], condition: Condition, config: NetworkConfig
) -> Context:
    """Describe context points (metres) and the condition."""
    frame = frame_of(condition)
    relative = frame.relative(points)
    bounds = np.quantile(points, [EDGE, 1 - EDGE], axis=0)
    surface = Surface(condition)
    own = own_features(points, surface, frame, bounds)
    around = _around(relative, own)
    token = farthest_points(relative, config.scene_tokens)
    _, assigned = cKDTree(relative[token]).query(relative)
    features = np.concatenate([own, around], axis=1)
    return Context(
        frame,
        surface,
        bounds,
        relative,
        around,
        features.astype(np.float32),
        token,
        np.asarray(assigned),
        _condition_features(condition, relative, frame, config).astype(np.float32),
    )


def describe_points(points: Float[np.ndarray, "n 3"], context: Context) -> Float[np.ndarray, "n f"]:
    """Describe points (metres) to ask about; each by itself and its nearest context point."""
    _, nearest = cKDTree(context.points).query(context.frame.relative(points))
    own = own_features(points, context.surface, context.frame, context.bounds)
    return np.concatenate([own, context.around[nearest]], axis=1).astype(np.float32)


def frame_of(condition: Condition) -> Frame:
    """Return the condition's frame."""
    box = condition.box
    return Frame(box.mean(axis=0), condition.size)


def own_features(
    points: Float[np.ndarray, "n 3"],
    surface: Surface,
    frame: Frame,
    bounds: Float[np.ndarray, "2 3"],
) -> Float[np.ndarray, "n 18"]:
    """Return place, distance to the condition (plain and log), side, direction, normal, and the
    place in the crop, whose relaxed box is about the object.
    """
    lying = surface.ask(points)
    distance = lying.distance / frame.size
    side = np.einsum("ni,ni->n", lying.towards, lying.normal)
    low = (surface.condition.box[1, 1] - points[:, 1]) / frame.size
    return np.column_stack(
        [
            frame.relative(points),
            np.minimum(distance, 2.0),
            np.log10(distance + LEAST_DISTANCE) + 1.5,
            side,
            lying.towards * np.minimum(distance, 1.0)[:, None],
            lying.normal,
            low,
            np.full(len(points), np.log10(frame.size) + 0.5),
            side * np.minimum(distance, 1.0),
            np.clip(
                (points - bounds.mean(axis=0)) / np.maximum(np.ptp(bounds, axis=0), 1e-9), -1, 1
            ),
        ]
    )


def _around(relative: Float[np.ndarray, "c 3"], own: np.ndarray) -> Float[np.ndarray, "c 21"]:
    near = neighbours(relative)
    fine, coarse = local_shape(relative, near[:, :FINE]), local_shape(relative, near)
    level = np.abs(fine.normal[:, 1]) > LEVEL
    height = -relative[:, 1]
    density = layer_density(height, level)
    on_layer = level & (density > LAYER_SHARE)
    spacing = float(np.median(np.linalg.norm(relative[near[:, 4]] - relative, axis=1)))
    cluster = clusters(relative, on_layer, LINK * spacing)
    agreement = np.abs(np.einsum("ni,ni->n", fine.normal, own[:, 9:12]))
    return np.column_stack(
        [
            np.abs(fine.normal[:, 1]),
            fine.flatness,
            agreement,
            np.abs(coarse.normal[:, 1]),
            coarse.flatness,
            coarse.offset[:, 1],
            own[near, 4].mean(axis=1),
            np.minimum(fine.radius, 1.0),
            density,
            np.clip(height - strongest_layer(height, density, level), -2, 2),
            cluster_features(relative, cluster, own[:, 3] < NEAR),
        ]
    )


def _condition_features(
    condition: Condition,
    scene: Float[np.ndarray, "c 3"],
    frame: Frame,
    config: NetworkConfig,
) -> Float[np.ndarray, "k 8"]:
    """Return place, normal and distance to the scene of evenly chosen condition samples."""
    relative = frame.relative(condition.points)
    chosen = farthest_points(relative, config.object_tokens)
    distance, _ = cKDTree(scene).query(relative[chosen])
    return np.column_stack(
        [
            relative[chosen],
            normals(condition.triangles)[condition.on[chosen]],
            np.log10(distance + LEAST_DISTANCE) + 1.5,
            np.full(len(chosen), np.log10(frame.size) + 0.5),
        ]
    )


def farthest_points(points: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, " m"]:
    """Return indices of points that lie far from each other, first the one nearest to 0."""
    chosen = np.zeros(min(count, len(points)), np.int64)
    chosen[0] = np.argmin(np.square(points).sum(axis=1))
    left = np.square(points - points[chosen[0]]).sum(axis=1)
    for k in range(1, len(chosen)):
        chosen[k] = np.argmax(left)
        np.minimum(left, np.square(points - points[chosen[k]]).sum(axis=1), out=left)
    return chosen
