"""Align a reconstruction with gravity: read the cues, fuse them, build Gravity-View."""

from __future__ import annotations

from garden_models.geometry.gravity_view import gv_from_world
from garden_models.gravity import read_cue
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.fuse import fuse_cues
from garden_models.gravity.protocol import Cue
from garden_models.gravity.reference_view import reference_view
from garden_models.progress import Progress, silent
from garden_models.scene import GravityView, Reconstruction


def align_gravity(
    reconstruction: Reconstruction,
    config: AlignGravity = AlignGravity(),
    progress: Progress = silent,
) -> GravityView:
    """Return the Gravity-View frame (paper, section 3.1) of the most central view.

    ``GravityView.evidence`` holds every method's part, ``sigma_deg`` the expected angular
    error (root mean square). The verdict is degraded where methods contradict each other,
    only one speaks, another axis is nearly as likely, or the uncertainty is large. Raises
    BadGeometry where nothing tells about gravity at all.
    """
    reference = reconstruction.views[reference_view(reconstruction)]
    cues: list[Cue] = []
    for done, name in enumerate(config.methods):
        progress(done / len(config.methods), f"gravity from {name.replace('_', ' ')}")
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
