"""Predict how much GPU memory a model needs for so many photos."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

WEIGHT_FILES = ("model.safetensors", "model.pt")
RUNTIME_GB = 1.0
"""What CUDA and torch's allocator take before anything is computed."""
USABLE = 0.9
"""Share of the stated memory that is planned with; the rest is lost between allocations."""


@dataclass(frozen=True)
class MemoryNeed:
    """``fixed_gb + per_photo_gb * n + per_early_photo_gb * min(n, early)`` gigabytes (1e9).

    Heads work through the photos in batches of ``early``: they need more for each photo of
    the first batch, and no more for later ones.
    """

    fixed_gb: float
    per_photo_gb: float
    per_early_photo_gb: float = 0.0
    early: int = 0

    def gb(self, photos: int) -> float:
        """Return what so many photos need."""
        early = self.per_early_photo_gb * min(photos, self.early)
        return self.fixed_gb + self.per_photo_gb * photos + early

    def most_photos(self, gpu_memory_gb: float) -> int:
        """Return how many photos fit the stated memory (0: none)."""
        room = gpu_memory_gb * USABLE - self.fixed_gb
        if room < (self.per_photo_gb + self.per_early_photo_gb) * self.early:
            return max(0, int(room / (self.per_photo_gb + self.per_early_photo_gb)))
        return int((room - self.per_early_photo_gb * self.early) / self.per_photo_gb)


def weights_gb(folder: Path) -> float:
    """Return the size of a folder's weights, which a GPU holds as they are stored."""
    sizes = [(folder / name).stat().st_size for name in WEIGHT_FILES if (folder / name).is_file()]
    return (sizes[0] if sizes else 0) / 1e9
