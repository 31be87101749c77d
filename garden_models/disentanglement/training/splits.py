"""Keep training, validation and test apart: by shape and by scene, never by sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from garden_models.scene import BadInput

Split = Literal["train", "validation", "test"]
SPLITS: tuple[Split, ...] = ("train", "validation", "test")

_MEMBERS = {"train": (0, 3000), "validation": (3000, 3400), "test": (3400, 4000)}
_SCENES = {
    "train": (0, 1_000_000),
    "validation": (1_000_000, 1_100_000),
    "test": (1_100_000, 1_200_000),
}
_SHARES = {"train": 0.7, "validation": 0.1, "test": 0.2}
"""Shares of named meshes (from packages): the paper holds out a fifth."""


@dataclass(frozen=True)
class Allowed:
    """What a split may use: half-open ranges of family members and of scene numbers."""

    split: Split
    members: tuple[int, int]
    scenes: tuple[int, int]

    def scene(self, number: int) -> int:
        """Return the seed of the split's scene number. Raises BadInput if there are no more."""
        first, end = self.scenes
        if not 0 <= number < end - first:
            raise BadInput(f"the {self.split} split has scenes 0 to {end - first - 1}")
        return first + number


def allowed(split: Split) -> Allowed:
    """Return a split's shapes and scenes."""
    return Allowed(split, _MEMBERS[split], _SCENES[split])


def split_of_name(name: str) -> Split:
    """Return the one split that a named mesh belongs to, whoever asks."""
    from zlib import crc32

    place = crc32(name.encode()) / 2**32
    for split in SPLITS:
        place -= _SHARES[split]
        if place < 0:
            return split
    return SPLITS[-1]
