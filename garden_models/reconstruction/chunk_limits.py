"""Configure how a long capture is divided."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.scene import BadInput


@dataclass(frozen=True)
class ChunkLimits:
    """``gpu_memory_gb`` is what the model may use; neighbouring chunks share ``overlap`` photos."""

    gpu_memory_gb: float = 24.0
    overlap: int = 8

    def __post_init__(self) -> None:
        if self.gpu_memory_gb <= 0:
            raise BadInput(f"gpu_memory_gb is {self.gpu_memory_gb}: state what the GPU has")
        if self.overlap < 1:
            raise BadInput(f"overlap is {self.overlap}: chunks must share at least one photo")
