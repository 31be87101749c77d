"""Ask a promptable segmentation model of the SAM family for the mask in each box.

Its pictures are squares: a photo is squeezed to one without keeping its proportions, boxes are
squeezed alike, and mask logits are stretched back. All of it is done here, on torch alone; the
network's own forward pass is all that is taken from outside.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from garden_models.foundation.imports import check_files, import_code
from garden_models.foundation.model_card import ModelCard
from garden_models.scene import BadInput
from garden_models.segmentation.mask_model import MaskAnswer, MaskBoxes, MaskRequest

Colour = tuple[float, float, float]


def load_promptable(
    card: ModelCard, network: str, weights: Path, device: str, mean: Colour, std: Colour
) -> MaskBoxes:
    """Return what asks the network, a class of transformers, with weights from a folder.

    ``mean`` and ``std`` (of 1) normalise colours. Raises BadInput if transformers lacks the
    network, a file is missing, or the weights are of another network.
    """
    check_files(card, weights)
    module = import_code(card, "transformers")
    if not hasattr(module, network):
        raise BadInput(f"{card.title} needs transformers with {network}: {card.install}")
    try:
        model, found = getattr(module, network).from_pretrained(
            weights, local_files_only=True, output_loading_info=True, dtype=torch.float32
        )
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{weights} does not hold {card.title}: {error}") from error
    absent = sorted(found["missing_keys"]) + sorted(str(k) for k in found["mismatched_keys"])
    if absent:
        raise BadInput(
            f"the weights in {weights} are not those of {card.title}: {len(absent)} of its "
            f"parameters are missing, {absent[0]} first; download them again"
        )
    return BoxPrompter(model.to(device).eval(), device, mean, std)


class BoxPrompter:
    """Answers mask requests with a network of the SAM family."""

    def __init__(self, model: Any, device: str, mean: Colour, std: Colour) -> None:
        self._model = model
        self._device = device
        self._mean, self._std = mean, std
        size = model.config.prompt_encoder_config.image_size
        self._side = int(size if isinstance(size, int) else size[0])

    def __call__(self, request: MaskRequest) -> MaskAnswer:
        """Return one mask a box and the network's own score for it."""
        height, width = request.rgb.shape[:2]
        boxes = np.asarray(request.boxes, np.float32).reshape(-1, 4)
        if not np.isfinite(boxes).all() or not (boxes[:, 2:] > boxes[:, :2]).all():
            raise BadInput(f"boxes must be x0 < x1, y0 < y1 in pixels, got {boxes.tolist()}")
        if len(boxes) == 0:
            return MaskAnswer(np.zeros((0, height, width), bool), np.zeros(0, np.float32))
        with torch.inference_mode():
            out = self._model(
                pixel_values=squeezed(request.rgb, self._side, self._mean, self._std).to(
                    self._device
                ),
                input_boxes=squeezed_boxes(boxes, (width, height), self._side).to(self._device),
                multimask_output=False,
            )
            masks = stretched(out.pred_masks[0, :, 0].float(), (width, height)).cpu().numpy()
            there = torch.sigmoid(out.object_score_logits[0].float().reshape(-1))
            scores = (out.iou_scores[0, :, 0].float().clip(0, 1) * there).cpu().numpy()
        return MaskAnswer(masks, scores.astype(np.float32))


def squeezed(
    rgb: UInt8[np.ndarray, "h w 3"], side: int, mean: Colour, std: Colour
) -> Float[torch.Tensor, "1 3 s s"]:
    """Return the photo as the network takes it: ``side`` x ``side``, colours normalised."""
    picture = torch.from_numpy(np.ascontiguousarray(rgb)).permute(2, 0, 1)[None].float()
    small = torch.nn.functional.interpolate(
        picture, size=(side, side), mode="bilinear", align_corners=False, antialias=True
    )
    levels = small.round().clip(0, 255) / 255.0
    centre, spread = (torch.tensor(v).reshape(1, 3, 1, 1) for v in (mean, std))
    return (levels - centre) / spread


def squeezed_boxes(
    boxes: Float[np.ndarray, "k 4"], size: tuple[int, int], side: int
) -> Float[torch.Tensor, "1 k 4"]:
    """Return boxes of a photo of ``size`` (width, height) in pixels of the network's square."""
    factor = np.array([side / size[0], side / size[1]] * 2, np.float32)
    return torch.from_numpy(np.asarray(boxes, np.float32) * factor)[None]


def stretched(
    logits: Float[torch.Tensor, "k h w"], size: tuple[int, int]
) -> Bool[torch.Tensor, "k H W"]:
    """Return masks of the photo's ``size`` (width, height): where upsampled logits are positive."""
    large = torch.nn.functional.interpolate(
        logits[:, None], size=(size[1], size[0]), mode="bilinear", align_corners=False
    )
    return large[:, 0] > 0
