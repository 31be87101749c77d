"""Align a predicted reconstruction with gravity: camera tokens beside the other cues."""

from __future__ import annotations

from garden_models.geometry.gravity_view import gv_from_world
from garden_models.gravity import read_cue
from garden_models.gravity.camera_tokens import token_cue
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.fuse import fuse_cues
from garden_models.gravity.reference_view import reference_view
from garden_models.gravity.token_config import TokenGravity
from garden_models.progress import Progress, silent
from garden_models.reconstruction.geometry_model import GeometryPrediction
from garden_models.scene import GravityView, Reconstruction


def align_gravity_by_tokens(
    reconstruction: Reconstruction,
    prediction: GeometryPrediction,
    config: AlignGravity,
    tokens: TokenGravity,
    progress: Progress = silent,
) -> GravityView:
    """Return the Gravity-View frame, with the decoder of camera tokens as one more cue.

    The reconstruction must be the prediction's own: its world differs by the scale only.
    Raises BadInput for tokens or a checkpoint that do not fit, BadGeometry where nothing tells
    about gravity at all.
    """
    reference = reconstruction.views[reference_view(reconstruction)]
    progress(0.0, "gravity from camera tokens")
    cues = [token_cue(prediction, tokens)]
    for done, name in enumerate(config.methods, start=1):
        progress(done / (len(config.methods) + 1), f"gravity from {name.replace('_', ' ')}")
        cue = read_cue(name, reconstruction, config.decoder_weights)
        if cue is not None:
            cues.append(cue)
    fused = fuse_cues(tuple(cues), config.max_disagreement_deg)
    progress(1.0, "gravity known")
    return GravityView(
        gv_from_world(fused.down_world, reference.camera_from_world),
        reference.photo,
        fused.down_world,
        fused.sigma_deg,
        fused.evidence,
        fused.verdict,
    )
