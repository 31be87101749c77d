"""Hold the settings of object-scene pairs (light to import)."""

from __future__ import annotations

from dataclasses import dataclass, field

from garden_models.disentanglement.training.augmentations.config import NONE, Augmentations


@dataclass(frozen=True)
class CropConfig:
    """Sizes of crops; ranges are uniform."""

    sideways: tuple[float, float] = (0.1, 0.6)
    above: tuple[float, float] = (0.1, 0.5)
    below: tuple[float, float] = (0.03, 0.3)
    """Expansion of the box on each side, of the object's longest extent."""
    pool: int = 8192
    """Points drawn; augmentations choose among them."""
    samples: int = 2048
    """Condition points."""
    least_size: float = 0.03
    most_size: float = 3.0
    least_extent: float = 0.008
    """Metres; what is smaller, larger or flatter is no target (supplement: extreme dimensions,
    degenerate boxes)."""
    least_positive: float = 0.03
    """Share of a crop's points that must be the object's."""


@dataclass(frozen=True)
class PairsConfig:
    """How pairs are made."""

    points: int = 3072
    """Points of a pair; the first ``CONTEXT_POINTS`` are context."""
    pairs_a_room: int = 12
    augmentations: Augmentations = field(default_factory=Augmentations)
    augmented: float = 1.0
    """Share of the pairs that are augmented."""
    crop: CropConfig = field(default_factory=CropConfig)


CLEAN = PairsConfig(augmentations=NONE, augmented=0.0)
