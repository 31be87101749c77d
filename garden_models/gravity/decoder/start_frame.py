"""Choose the frame in which tokens are written: Gravity-View as if gravity were known."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from garden_models.geometry.gravity_view import gv_from_camera
from garden_models.gravity.decoder.evidence import ViewEvidence
from garden_models.gravity.decoder.summits import summits

Rotation = Float[np.ndarray, "3 3"]
Direction = Float[np.ndarray, "3"]


def frame_of(down_world: Direction, reference_rotation: Rotation) -> Rotation:
    """Return ``gv_from_world`` of a reference camera if ``down_world`` were gravity.

    Where it is gravity, it is what the decoder should find: the decoder then answers with the
    identity.
    """
    return gv_from_camera(reference_rotation @ down_world) @ reference_rotation


def habitual_down(rotations: Float[np.ndarray, "v 3 3"], reference: int) -> Direction:
    """Return the mean direction down of cameras taken to be upright."""
    mean = rotations[:, 1].mean(axis=0)
    if np.linalg.norm(mean) < 0.2:
        mean = rotations[reference, 1]
    return np.asarray(mean / np.linalg.norm(mean))


def starts(evidence: ViewEvidence) -> Float[np.ndarray, "n 3"]:
    """Return directions that may be down: the habitual one, its opposite, four level with it,
    and both signs of every direction that surfaces or lines agree on.

    The first six are within 55 degrees of every direction, so that also what was photographed
    in no habitual way starts not far off; the others are often exact, or exactly wrong.
    """
    rotation = evidence.rotation
    frame = frame_of(habitual_down(rotation, evidence.reference), rotation[evidence.reference])
    agreed = summits(evidence)
    return np.concatenate([frame, -frame, agreed, -agreed])
