"""Bring the predictions of overlapping chunks of photos into one world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from garden_models.reconstruction.geometry_model import (
    CameraTokens,
    Gaussians,
    GeometryPrediction,
    GeometryView,
    joined_gaussians,
)
from garden_models.reconstruction.photo_chunks import owners
from garden_models.reconstruction.similarity import IDENTITY, Similarity
from garden_models.reconstruction.view_alignment import align_views
from garden_models.scene import Verdict

MAX_MISFIT = 0.05
"""Share of the depth by which joined chunks may miss each other before the result is doubted."""


def merge_chunks(
    predictions: Sequence[GeometryPrediction], chunks: tuple[range, ...], same_world: bool
) -> GeometryPrediction:
    """Return one prediction of all photos.

    With ``same_world`` (cameras were given) chunks are taken as they are; else each is aligned
    with those before it by all photos that it shares with them. Metric chunks know metres each
    for itself; the median of what they say holds. The verdict is degraded where chunks do not
    fit each other. Raises BadGeometry if two chunks cannot be joined.
    """
    moves, verdict = [IDENTITY] * len(predictions), Verdict()
    if not same_world:
        moves, verdict = _moves(predictions, chunks)
    photos = chunks[-1].stop
    owner = owners(chunks, photos)
    views = tuple(
        moves[owner[p]].view(predictions[owner[p]].views[p - chunks[owner[p]].start])
        for p in range(photos)
    )
    tokens = tuple(
        _tokens_of(token, chunk)
        for prediction, chunk in zip(predictions, chunks, strict=True)
        for token in prediction.camera_tokens
    )
    for prediction in predictions:
        verdict = verdict.worst(prediction.verdict)
    return GeometryPrediction(
        views,
        all(prediction.metric for prediction in predictions),
        tokens,
        _gaussians(predictions, chunks, moves, np.array(owner)),
        verdict,
    )


def _moves(
    predictions: Sequence[GeometryPrediction], chunks: tuple[range, ...]
) -> tuple[list[Similarity], Verdict]:
    moves = [IDENTITY]
    placed: dict[int, GeometryView] = dict(enumerate(predictions[0].views))
    reasons = []
    for prediction, chunk in zip(predictions[1:], chunks[1:], strict=True):
        shared = [photo for photo in chunk if photo in placed]
        joint = align_views(
            [prediction.views[photo - chunk.start] for photo in shared],
            [placed[photo] for photo in shared],
        )
        moves.append(joint.b_from_a)
        for photo, view in zip(chunk, prediction.views, strict=True):
            placed.setdefault(photo, joint.b_from_a.view(view))
        if joint.misfit > MAX_MISFIT:
            reasons.append(
                f"photos {chunk.start + 1} to {chunk.stop} join those before them with an error "
                f"of {joint.misfit:.0%} of the depth: state more GPU memory, or take photos "
                "that overlap more"
            )
    if all(prediction.metric for prediction in predictions):
        metres = Similarity(float(np.median([1 / m.scale for m in moves])), np.eye(3), np.zeros(3))
        moves = [metres.after(move) for move in moves]
    return moves, Verdict("degraded", tuple(reasons)) if reasons else Verdict()


def _tokens_of(tokens: CameraTokens, chunk: range) -> CameraTokens:
    return replace(
        tokens, views=tokens.views + chunk.start, reference=tokens.reference + chunk.start
    )


def _gaussians(
    predictions: Sequence[GeometryPrediction],
    chunks: tuple[range, ...],
    moves: Sequence[Similarity],
    owner: np.ndarray,
) -> Gaussians | None:
    parts = []
    for k, (prediction, chunk) in enumerate(zip(predictions, chunks, strict=True)):
        if prediction.gaussians is None:
            return None
        found = replace(prediction.gaussians, view=prediction.gaussians.view + chunk.start)
        parts.append(moves[k].gaussians(found.subset(owner[found.view] == k)))
    return joined_gaussians(parts)
