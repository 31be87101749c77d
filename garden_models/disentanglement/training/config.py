"""Hold the settings of training, and the presets (light to import)."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.disentanglement.network.config import PAPER as PAPER_NETWORK
from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.training.augmentations.config import (
    PAPER as PAPER_AUGMENTATIONS,
)
from garden_models.disentanglement.training.augmentations.config import (
    Augmentations,
    MeshJitter,
)
from garden_models.disentanglement.training.pairs_config import PairsConfig
from garden_models.scene import BadInput


@dataclass(frozen=True)
class Optimisation:
    """How weights are found; the paper's numbers are the defaults."""

    steps: int = 2000
    batch: int = 48
    learning_rate: float = 5e-4
    warm_up: int = 100
    decay: bool = True
    """Whether the rate falls to nothing along a cosine."""
    weight_decay: float = 0.01
    points: int = 1024
    """Points asked about in each pair of a batch."""
    token_loss: float = 0.0
    """Weight of the same loss on the scene tokens."""
    symmetries: bool = False
    """Whether pairs are turned by quarters and mirrored as they are read."""
    seed: int = 0
    threads: int = 2
    """Fixed, since sums of other numbers of threads differ in their last bits."""
    device: str = "cpu"


@dataclass(frozen=True)
class TrainingPreset:
    """A whole training: data, network, optimisation."""

    name: str
    rooms: int
    validation_rooms: int
    test_rooms: int
    rooms_a_shard: int
    checkpoint_every: int
    pairs: PairsConfig
    network: NetworkConfig
    optimisation: Optimisation
    packages: bool = False
    """Whether meshes of installed packages stand in the rooms too."""


_MIXED = PairsConfig(
    augmentations=Augmentations(each=0.8, mesh_jitter=MeshJitter(gentle=0.3)), augmented=0.75
)

SMOKE = TrainingPreset(
    name="smoke",
    rooms=6,
    validation_rooms=2,
    test_rooms=2,
    rooms_a_shard=3,
    checkpoint_every=20,
    pairs=_MIXED,
    network=NetworkConfig(width=32, token_layers=1, point_layers=1, scene_tokens=96),
    optimisation=Optimisation(
        steps=60, batch=8, learning_rate=2e-3, warm_up=10, token_loss=0.5, points=512
    ),
)
CPU = TrainingPreset(
    name="cpu",
    rooms=200,
    validation_rooms=10,
    test_rooms=20,
    rooms_a_shard=20,
    checkpoint_every=200,
    pairs=_MIXED,
    network=NetworkConfig(width=64, token_layers=3, point_layers=2, scene_tokens=160),
    optimisation=Optimisation(
        steps=2400, batch=16, learning_rate=2e-3, token_loss=0.5, symmetries=True, points=640
    ),
)
PAPER = TrainingPreset(
    name="paper",
    rooms=2000,
    validation_rooms=50,
    test_rooms=100,
    rooms_a_shard=50,
    checkpoint_every=250,
    pairs=PairsConfig(augmentations=PAPER_AUGMENTATIONS, augmented=0.75),
    network=PAPER_NETWORK,
    optimisation=Optimisation(points=2048),
)
PRESETS = {preset.name: preset for preset in (SMOKE, CPU, PAPER)}


def training_preset(name: str) -> TrainingPreset:
    """Return a preset by name. Raises BadInput if there is none."""
    if name not in PRESETS:
        raise BadInput(f"no training preset called {name!r}: use one of {', '.join(PRESETS)}")
    return PRESETS[name]
