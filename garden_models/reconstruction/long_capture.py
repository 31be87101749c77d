"""Predict the geometry of as many photos as there are, within a stated amount of GPU memory."""

from __future__ import annotations

from dataclasses import replace

from garden_models.foundation.failure import ModelOutOfMemory
from garden_models.progress import Progress, silent
from garden_models.reconstruction.chunk_limits import ChunkLimits
from garden_models.reconstruction.chunk_merging import merge_chunks
from garden_models.reconstruction.geometry_model import (
    GeometryPrediction,
    GeometryRequest,
    PredictGeometry,
)
from garden_models.reconstruction.memory_need import MemoryNeed
from garden_models.reconstruction.photo_chunks import photo_chunks
from garden_models.scene import BadInput, Verdict

FEWEST_BEYOND_OVERLAP = 2
"""New photos that a chunk must hold beside those that it shares."""


def predict_long(
    request: GeometryRequest,
    predict: PredictGeometry,
    need: MemoryNeed,
    limits: ChunkLimits = ChunkLimits(),
    progress: Progress = silent,
) -> GeometryPrediction:
    """Return the geometry of all photos, in chunks where they do not fit at once.

    How many fit is predicted by ``need``. Where memory runs out all the same, chunks are
    halved, and the verdict says so. Raises BadInput if not even the smallest chunk should fit,
    ModelOutOfMemory if it does not.
    """
    photos = len(request.photos)
    size = min(photos, need.most_photos(limits.gpu_memory_gb))
    fewest = min(photos, limits.overlap + FEWEST_BEYOND_OVERLAP)
    if size < fewest:
        raise BadInput(
            f"{fewest} photos at once need about {need.gb(fewest):.1f} GB of GPU memory, "
            f"{limits.gpu_memory_gb:g} GB are stated: state more (gpu_memory_gb) if there is more, "
            "or use a smaller model"
        )
    remarks: tuple[str, ...] = ()
    while True:
        merged = _in_chunks(request, predict, size, limits, progress)
        if merged is not None:
            return replace(merged, verdict=merged.verdict.worst(Verdict("ok", remarks)))
        smaller = max(fewest, -(-size // 2))
        if smaller == size:
            raise ModelOutOfMemory(
                f"GPU memory ran out with {size} photos at once, the fewest that can be joined: "
                "close what else uses the GPU, or use a smaller model"
            )
        remarks += (
            f"GPU memory ran out with {size} photos at once; predicted {smaller} at once instead",
        )
        size = smaller


def _in_chunks(
    request: GeometryRequest,
    predict: PredictGeometry,
    size: int,
    limits: ChunkLimits,
    progress: Progress,
) -> GeometryPrediction | None:
    """Return the merged prediction; None if memory ran out."""
    chunks = photo_chunks(len(request.photos), size, limits.overlap)
    predictions = []
    for done, chunk in enumerate(chunks):
        progress(done / len(chunks), f"photos {chunk.start + 1} to {chunk.stop}")
        try:
            predictions.append(predict(part_of(request, chunk)))
        except MemoryError:
            return None
    if len(chunks) == 1:
        return predictions[0]
    return merge_chunks(predictions, chunks, request.camera_from_world is not None)


def part_of(request: GeometryRequest, chunk: range) -> GeometryRequest:
    """Return the request for some of its photos."""
    part = slice(chunk.start, chunk.stop)
    return replace(
        request,
        photos=request.photos[part],
        K=None if request.K is None else request.K[part],
        camera_from_world=None
        if request.camera_from_world is None
        else request.camera_from_world[part],
    )
