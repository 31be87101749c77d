"""Label the nodes of a graph by random walks with priors (Grady 2005, "Multilabel random
walker image segmentation using prior models").

The probability of a label is the minimiser of ``sum_ij w_ij (x_i - x_j)^2 +
sum_i s_i (x_i - p_i)^2``: neighbours with a strong edge agree, and each node is drawn to its
prior ``p_i`` with strength ``s_i``. It is solved by conjugate gradients with Jacobi
preconditioning; probabilities of all labels sum to 1 because the priors do.

A walk blurs a border over many nodes. Walks that start from an earlier result first weaken
the edges across which that result changes (iteratively reweighted least squares): the
squares then act like absolute values, and the border gathers on the weakest edges, as in a
minimal cut.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy import sparse

LEAST_STRENGTH = 1e-5
"""Draws nodes without any evidence to their prior, so that the system has one solution."""
STEP = 0.05
"""Change of probability along an edge from which on reweighting halves its weight."""
TOLERANCE = 2e-3
"""Relative residual at which a solution is good: far finer than the threshold at 0.5."""
MAX_ITERATIONS = 300

ImageEdges = tuple[
    Float32[np.ndarray, "h w_1"],
    Float32[np.ndarray, "h_1 w"],
    Float32[np.ndarray, "h_1 w_1"],
    Float32[np.ndarray, "h_1 w_1"],
]
"""Edge weights to the right, down, down-right and down-left of the pixels of an image;
entry (y, x) of the last joins pixel (y, x + 1) with (y + 1, x).
"""


def walk_on_graph(
    edges: Int[np.ndarray, "e 2"],
    weights: Float[np.ndarray, " e"],
    prior: Float[np.ndarray, "n labels"],
    strength: Float[np.ndarray, " n"],
    start: Float[np.ndarray, "n labels"] | None = None,
) -> Float[np.ndarray, "n labels"]:
    """Return label probabilities of the nodes; each edge stands once, in either direction.

    ``start`` is an earlier result to sharpen (default: none).
    """
    count = len(prior)
    i, j = edges.T
    if start is not None:
        weights = weights / (1 + np.abs(start[i] - start[j]).max(1) / STEP)
    half = sparse.coo_matrix((weights, (i, j)), shape=(count, count)).tocsr()
    adjacency = (half + half.T).tocsr()
    strength = np.maximum(strength, LEAST_STRENGTH)
    diagonal = np.asarray(adjacency.sum(1)).ravel() + strength
    start = prior if start is None else start
    columns = [
        _solve(lambda x: diagonal * x - adjacency @ x, diagonal, strength * p, x0)
        for p, x0 in zip(prior.T[:-1], start.T[:-1], strict=True)
    ]
    return np.stack([*columns, np.clip(1 - np.sum(columns, axis=0), 0, 1)], axis=1)


def walk_on_image(
    edges: ImageEdges,
    prior: Float32[np.ndarray, "h w"],
    strength: Float32[np.ndarray, "h w"],
    start: Float32[np.ndarray, "h w"] | None = None,
) -> Float32[np.ndarray, "h w"]:
    """Return the probability of the first of two labels for pixels joined to 8 neighbours.

    ``prior`` is that label's; ``start`` as for ``walk_on_graph``.
    """
    if start is not None:
        edges = _reweighted(edges, start)
    strength = np.maximum(strength, np.float32(LEAST_STRENGTH))
    right, down, falling, rising = edges
    pieces: tuple[tuple[np.ndarray, Any, Any], ...] = (
        (right, np.s_[:, :-1], np.s_[:, 1:]),
        (down, np.s_[:-1], np.s_[1:]),
        (falling, np.s_[:-1, :-1], np.s_[1:, 1:]),
        (rising, np.s_[:-1, 1:], np.s_[1:, :-1]),
    )
    room = [np.empty_like(weights) for weights, _, _ in pieces]

    def spread(x: np.ndarray) -> np.ndarray:
        out = np.zeros_like(x)
        for (weights, here, there), product in zip(pieces, room, strict=True):
            np.multiply(weights, x[there], out=product)
            out[here] += product
            np.multiply(weights, x[here], out=product)
            out[there] += product
        return out

    diagonal = spread(np.ones_like(strength)) + strength
    return _solve(
        lambda x: diagonal * x - spread(x),
        diagonal,
        strength * prior,
        prior if start is None else start,
    )


def _reweighted(edges: ImageEdges, x: Float32[np.ndarray, "h w"]) -> ImageEdges:
    """Weaken the edges across which ``x`` changes."""
    right, down, falling, rising = edges
    step = np.float32(1 / STEP)
    return (
        right / (1 + step * np.abs(x[:, 1:] - x[:, :-1])),
        down / (1 + step * np.abs(x[1:] - x[:-1])),
        falling / (1 + step * np.abs(x[1:, 1:] - x[:-1, :-1])),
        rising / (1 + step * np.abs(x[1:, :-1] - x[:-1, 1:])),
    )


def _solve(
    product: Callable[[np.ndarray], np.ndarray],
    diagonal: np.ndarray,
    right_side: np.ndarray,
    start: np.ndarray,
) -> np.ndarray:
    """Solve the walk's linear system for one label; clip to 0..1."""
    x = start.copy()
    residual = right_side - product(x)
    limit = TOLERANCE**2 * max(_dot(right_side, right_side / diagonal), 1e-30)
    z = residual / diagonal
    direction, power = z.copy(), _dot(residual, z)
    for _ in range(MAX_ITERATIONS):
        if power <= limit:
            break
        image = product(direction)
        step = x.dtype.type(power / max(_dot(direction, image), 1e-30))
        x += step * direction
        residual -= step * image
        np.divide(residual, diagonal, out=z)
        power, before = _dot(residual, z), power
        direction *= x.dtype.type(power / max(before, 1e-30))
        direction += z
    return np.clip(x, 0, 1)


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.dot(a.ravel(), b.ravel()))
