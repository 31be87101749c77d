"""Hold the settings of the decoder's training, and the presets (light to import)."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.gravity.decoder.config import PAPER as PAPER_NETWORK
from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.token_layout import KIND, TOKEN_WIDTH
from garden_models.scene import BadInput


@dataclass(frozen=True)
class GravityOptimisation:
    """How weights are found; the paper's numbers are the defaults.

    The number of scenes in a batch follows from their number of views: ``tokens_a_batch`` is
    about the same for all batches.
    """

    steps: int = 10_000
    tokens_a_batch: int = 256
    learning_rate: float = 5e-6
    warm_up: int = 1000
    decay: bool = False
    weight_decay: float = 0.01
    seed: int = 0
    threads: int = 2
    """Fixed, since sums of other numbers of threads differ in their last bits."""
    device: str = "cpu"


@dataclass(frozen=True)
class GravityPreset:
    """A whole training: data, network, optimisation.

    ``scenes`` and ``validation_scenes`` are seen as evidence only, ``test_scenes`` are
    photographed.
    """

    name: str
    scenes: int
    validation_scenes: int
    test_scenes: int
    scenes_a_shard: int
    test_scenes_a_shard: int
    checkpoint_every: int
    network: DecoderConfig
    optimisation: GravityOptimisation


def embedded_network(width: int, blocks: int, heads: int, feature: int, head: int) -> DecoderConfig:
    """Return a decoder of embedded tokens that tells how sure it is."""
    return DecoderConfig(
        token_width=TOKEN_WIDTH,
        tokens=KIND,
        width=width,
        blocks=blocks,
        heads=heads,
        mlp_ratio=2,
        feature=feature,
        head=head,
        positions="reference",
        uncertain=True,
    )


SMOKE = GravityPreset(
    name="smoke",
    scenes=120,
    validation_scenes=40,
    test_scenes=4,
    scenes_a_shard=60,
    test_scenes_a_shard=4,
    checkpoint_every=40,
    network=embedded_network(64, 2, 4, 128, 64),
    optimisation=GravityOptimisation(
        steps=200, tokens_a_batch=64, learning_rate=1e-3, warm_up=20, decay=True, threads=1
    ),
)
CPU = GravityPreset(
    name="cpu",
    scenes=12_000,
    validation_scenes=800,
    test_scenes=60,
    scenes_a_shard=500,
    test_scenes_a_shard=10,
    checkpoint_every=1000,
    network=embedded_network(256, 4, 8, 512, 256),
    optimisation=GravityOptimisation(
        steps=20_000, tokens_a_batch=256, learning_rate=5e-4, warm_up=500, decay=True
    ),
)
PAPER = GravityPreset(
    name="paper",
    scenes=0,
    validation_scenes=800,
    test_scenes=60,
    scenes_a_shard=500,
    test_scenes_a_shard=10,
    checkpoint_every=1000,
    network=PAPER_NETWORK,
    optimisation=GravityOptimisation(),
)
"""The paper's network and optimisation on tokens of Depth-Anything-3, which the user's own
data sets and weights give."""
PRESETS = {preset.name: preset for preset in (SMOKE, CPU, PAPER)}


def gravity_preset(name: str) -> GravityPreset:
    """Return a preset by name. Raises BadInput if there is none."""
    if name not in PRESETS:
        raise BadInput(f"no training preset called {name!r}: use one of {', '.join(PRESETS)}")
    return PRESETS[name]
