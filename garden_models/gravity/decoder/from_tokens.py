"""Gravity from a backbone's camera tokens (paper, supplement A)."""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float

from garden_models.geometry.rotation import normalized
from garden_models.gravity.decoder.checkpoint import Checkpoint, check_tokens
from garden_models.scene import BadInput


def down_from_tokens(
    known: Checkpoint,
    tokens: Float[np.ndarray, "n c"],
    reference: int,
    camera_from_world: Float[np.ndarray, "n r 4"],
) -> tuple[Float[np.ndarray, "3"], float | None]:
    """Return the unit direction down in the world of the backbone's cameras, and the error that
    the network claims (radians, not calibrated; None if it claims none).

    The network gives the rotation from the reference view to Gravity-View; with the camera
    rotation of that view, ``gv_from_world = gv_from_reference @ reference_from_world``.

    Raises BadInput for tokens that the network cannot read, a reference view or cameras that
    do not go with them.
    """
    check_tokens(known, tokens)
    if not 0 <= reference < len(tokens) or len(camera_from_world) != len(tokens):
        raise BadInput(
            f"{len(tokens)} tokens, {len(camera_from_world)} cameras, reference view {reference}: "
            "give one camera a token, and the index of one of them"
        )
    with torch.inference_mode():
        found = known.model(
            torch.from_numpy(np.ascontiguousarray(tokens, np.float32))[None],
            torch.tensor([reference]),
        )
    gv_from_reference = found.rotation[0].numpy().astype(np.float64)
    claimed = None if found.log_sigma is None else float(found.log_sigma[0].exp())
    return normalized((gv_from_reference @ camera_from_world[reference, :3, :3])[1]), claimed
