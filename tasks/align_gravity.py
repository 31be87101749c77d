"""Turn a reconstruction upright (paper, section 3.1). Seconds, CPU.

Degraded when the cues disagree or only a weak one stands.
"""

from __future__ import annotations

from pathlib import Path

from garden_models.gravity import TRAINED
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.decoder.shipped import DIGEST
from garden_models.progress import Progress, silent
from garden_models.scene import BadInput, GravityView, Reconstruction
from tasks.step import step


def _weights(config: AlignGravity, **_others: object) -> dict[str, str | Path]:
    """Return the checkpoint of the decoder if it is asked: its content is part of the key."""
    if not set(config.methods) & set(TRAINED):
        return {}
    if config.decoder_weights:
        path = Path(config.decoder_weights)
        if not path.is_file():
            raise BadInput(f"no such checkpoint of a gravity decoder: {path}")
        return {"gravity_decoder": path}
    return {"gravity_decoder": DIGEST}


@step(
    version=1,
    packages=("numpy", "opencv-python-headless", "scipy", "torch", "safetensors"),
    weights=_weights,
    skip=("config.decoder_weights",),
)
def align_gravity(
    reconstruction: Reconstruction, config: AlignGravity, progress: Progress = silent
) -> GravityView:
    """Return the Gravity-View frame with every cue's evidence."""
    from garden_models.gravity.align import align_gravity as run

    return run(reconstruction, config, progress)
