"""Ask a network about any number of points, in chunks.

The context is chosen from the cloud in an order of its own (by coordinates), and every point is
answered from that context alone: neither the order of the points nor the size of the chunks
changes what is said of one, but for the last bits of a sum.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from garden_models.disentanglement.network.describe import (
    Context,
    describe_context,
    describe_points,
)
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.disentanglement.network.realign import realigned
from garden_models.disentanglement.training.pair import CONTEXT_POINTS, Condition
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput

CHUNK = 8192
PASSES = 3
"""How often the context is read at most."""
THINNED = 4 * CONTEXT_POINTS
"""Points that are left, evenly spread, before the context is drawn from them."""


def predict(
    model: PointClassifier,
    points: Float[np.ndarray, "n 3"],
    condition: Condition,
    chunk: int = CHUNK,
    progress: Progress = silent,
) -> Float[np.ndarray, " n"]:
    """Return each point's probability of being the object's (metres, y down).

    Raises BadInput for coordinates that are not finite or a condition without extent.
    """
    _check(points, condition)
    if not len(points):
        return np.zeros(0)
    return answer(model, points[choose_context(points)], points, condition, chunk, progress)


def answer(
    model: PointClassifier,
    seen: Float[np.ndarray, "c 3"],
    points: Float[np.ndarray, "n 3"],
    condition: Condition,
    chunk: int = CHUNK,
    progress: Progress = silent,
) -> Float[np.ndarray, " n"]:
    """Return probabilities of ``points`` from the context points ``seen``.

    The context is labelled first; where its object points show that the mesh lies elsewhere,
    it is laid onto them and the context is read again.
    """
    device = next(model.parameters()).device
    probability = np.empty(len(points))
    model.eval()
    with torch.inference_mode():
        context, tokens, places = _settled(model, seen, condition, device)
        for start in range(0, len(points), chunk):
            progress(start / len(points), f"{len(points)} points")
            asked = describe_points(points[start : start + chunk], context)
            logits = model(torch.from_numpy(asked)[None].to(device), tokens, places)
            probability[start : start + chunk] = logits[0].sigmoid().cpu().numpy()
    return probability


def _settled(
    model: PointClassifier, seen: np.ndarray, condition: Condition, device: torch.device
) -> tuple[Context, Tensor, Tensor]:
    """Return the context with the condition where the object's points are, and its tokens."""
    for left in reversed(range(PASSES)):
        context = describe_context(seen, condition, model.config)
        tokens, places = model.tokens(*context_tensors(context, device))
        if not left or not model.config.geometric:
            break
        features = torch.from_numpy(context.features)[None].to(device)
        taken = model(features, tokens, places)[0].cpu().numpy() >= 0
        better = realigned(seen[taken], condition)
        if better is None:
            break
        condition = better
    return context, tokens, places


def context_tensors(context: Context, device: torch.device) -> tuple[Tensor, ...]:
    """Return a context as the arguments of ``PointClassifier.tokens``, a batch of one."""
    arrays = (context.features, context.token, context.assigned, context.condition)
    return tuple(torch.from_numpy(np.asarray(a))[None].to(device) for a in arrays)


def choose_context(points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " c"]:
    """Return the indices of ``CONTEXT_POINTS`` points drawn evenly over the surfaces.

    The choice depends on the set of points only, not on their order. Fewer points are all
    taken, some twice.
    """
    order = np.lexsort(points.T)
    if len(order) > THINNED:
        order = order[_one_a_voxel(points[order], THINNED)]
    shuffled = np.random.default_rng(0).permutation(len(order))
    return np.asarray(order[np.resize(shuffled, CONTEXT_POINTS)])


def _one_a_voxel(points: Float[np.ndarray, "n 3"], wanted: int) -> Int[np.ndarray, " m"]:
    """Return the first point of each voxel, voxels so large that about ``wanted`` hold some."""
    low = points.min(axis=0)
    extent = float(np.ptp(points, axis=0).max())
    small, large = extent / 4096, extent / 4
    kept = np.arange(len(points))
    for _ in range(12):
        edge = float(np.sqrt(small * large))
        cell = np.floor((points - low) / edge).astype(np.int64)
        key = (cell[:, 0] * 8192 + cell[:, 1]) * 8192 + cell[:, 2]
        kept = np.unique(key, return_index=True)[1]
        if 0.9 * wanted <= len(kept) <= 1.1 * wanted:
            break
        small, large = (edge, large) if len(kept) > wanted else (small, edge)
    return np.sort(kept)


def _check(points: np.ndarray, condition: Condition) -> None:
    if not np.isfinite(points).all():
        raise BadInput("some scene points are not finite: drop them before they are labelled")
    if not (np.isfinite(condition.points).all() and np.isfinite(condition.triangles).all()):
        raise BadInput("the object mesh has coordinates that are not finite: mesh it again")
    if condition.size <= 0:
        raise BadInput("the object mesh has no extent: mesh it again")
