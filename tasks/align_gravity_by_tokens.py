"""Turn a predicted reconstruction upright by the model's camera tokens and the other cues
(paper, section 3.1 and supplement A). Seconds, CPU.

Degraded when the cues disagree or only a weak one stands.
"""

from __future__ import annotations

from pathlib import Path

from garden_models.gravity.config import AlignGravity
from garden_models.gravity.token_config import TokenGravity
from garden_models.progress import Progress, silent
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.scene import BadInput, GravityView, Reconstruction
from tasks.align_gravity import align_gravity
from tasks.step import step


def _weights(
    config: AlignGravity, tokens: TokenGravity, **_others: object
) -> dict[str, str | Path]:
    path = Path(tokens.weights)
    if not path.is_file():
        raise BadInput(f"no such checkpoint of a decoder of camera tokens: {path}")
    assert align_gravity.spec.weights is not None
    return {**align_gravity.spec.weights(config=config), "token_decoder": path}


@step(
    version=1,
    packages=("numpy", "opencv-python-headless", "scipy", "torch", "safetensors"),
    weights=_weights,
    skip=("config.decoder_weights", "tokens.weights"),
)
def align_gravity_by_tokens(
    reconstruction: Reconstruction,
    prediction: GeometryPrediction,
    config: AlignGravity,
    tokens: TokenGravity,
    progress: Progress = silent,
) -> GravityView:
    """Return the Gravity-View frame with every cue's evidence."""
    from garden_models.gravity.align_by_tokens import align_gravity_by_tokens as run

    return run(reconstruction, prediction, config, tokens, progress)
