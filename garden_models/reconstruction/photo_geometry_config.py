"""Configure where cameras and depth come from."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.reconstruction.chunk_limits import ChunkLimits

EMBEDDED = "embedded"


@dataclass(frozen=True)
class PhotoGeometry:
    """Where cameras and depth come from.

    ``method`` is ``embedded`` (structure from motion and stereo: the options of ``register``
    and ``reconstruct``) or a model's name. A model keeps to ``gpu_memory_gb``; what does not
    fit is predicted in chunks of which neighbours share ``overlap`` photos. ``gaussians`` and
    ``camera_tokens`` ask for these too, of a model that has them.
    """

    method: str = EMBEDDED
    gpu_memory_gb: float = 24.0
    overlap: int = 8
    gaussians: bool = False
    camera_tokens: bool = False

    def __post_init__(self) -> None:
        ChunkLimits(self.gpu_memory_gb, self.overlap)
