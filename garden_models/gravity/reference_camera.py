"""Ablation "w/o GV": the frame of the reference camera, as if it were held level.

Leaves gravity out: asked alone, it makes Gravity-View the reference camera's own frame.
"""

from __future__ import annotations

from garden_models.gravity.reference_view import reference_view
from garden_models.scene import GravityEvidence, Reconstruction

NOMINAL_SIGMA_DEG = 30.0
"""Photos look down by about this much; nothing is known of this one."""


def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
    """Return the y axis of the reference camera; None if there is no camera."""
    if not reconstruction.views:
        return None
    view = reconstruction.views[reference_view(reconstruction)]
    return GravityEvidence(
        "reference_camera",
        view.camera_from_world[1, :3].copy(),
        NOMINAL_SIGMA_DEG,
        True,
        f"the y axis of {view.photo}: gravity is left out",
    )
