"""Extract Depth-Anything-3's camera tokens and its reference view (the gravity decoder's input).

The token of a view is what its camera decoder reads: the class token of the last layer, local
and global halves joined, not normalised. Only the backbone runs.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Float

from garden_models.reconstruction.da3_network import STRATEGY, Da3Network, watching
from garden_models.reconstruction.da3_photos import prepare
from garden_models.reconstruction.photo_framing import Photo
from garden_models.scene import BadInput


def camera_tokens(
    network: Da3Network, photos: Sequence[Photo]
) -> tuple[Float[np.ndarray, "n c"], int]:
    """Return one token a photo, in their order, and the index of the reference view.

    Raises BadInput for a network that predicts no cameras.
    """
    if not network.poses:
        raise BadInput(f"{network.kind} has no camera tokens")
    pictures, _ = prepare(photos)
    batch = torch.from_numpy(pictures)[None].to(network.device)
    with watching(network) as watched:
        features, _ = network.anyview.backbone(
            batch, cam_token=None, export_feat_layers=[], ref_view_strategy=STRATEGY
        )
        tokens = features[-1][1][0].float().cpu().numpy()
        return tokens, watched.reference(len(photos), cameras_given=False)
