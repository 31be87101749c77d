"""A network of the SAM family that knows a scene's truth: one box in, that instance out.

It takes what transformers' trackers take (a square picture, normalised; boxes in its pixels) and
answers logits at a quarter of the size.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import torch

from tests.doubles.truth_scene import TruthScene

SIDE = 512


class PromptableNetwork:
    """``mean`` and ``std`` are those of its training; ``everything`` makes it answer the whole
    picture, as a model does that takes a box for a hint only.
    """

    def __init__(
        self,
        truth: TruthScene,
        mean: float | np.ndarray = 0.5,
        std: float | np.ndarray = 0.5,
        *,
        everything: bool = False,
    ) -> None:
        self.truth, self.mean, self.std, self.everything = truth, mean, std, everything
        self.config = SimpleNamespace(prompt_encoder_config=SimpleNamespace(image_size=SIDE))
        self.asked = 0

    def __call__(self, pixel_values, input_boxes, multimask_output):
        self.asked += 1
        assert multimask_output is False
        assert tuple(pixel_values.shape) == (1, 3, SIDE, SIDE)
        assert pixel_values.dtype == torch.float32
        assert input_boxes.ndim == 3 and input_boxes.shape[2] == 4
        boxes = input_boxes[0].numpy()
        assert (boxes >= -1).all() and (boxes <= SIDE + 1).all(), "boxes are in the square's pixels"
        rgb = (pixel_values[0].permute(1, 2, 0).numpy() * self.std + self.mean) * 255.0
        assert rgb.min() > -2 and rgb.max() < 257, "colours are normalised with other numbers"
        picture = np.clip(np.rint(rgb), 0, 255).astype(np.uint8)
        owner = self.truth.picture(self.truth.camera_of(picture), (SIDE, SIDE)).owner
        masks = np.stack([self._mask(owner, box) for box in boxes])
        fine = torch.tensor(np.where(masks, 8.0, -8.0), dtype=torch.float32)
        logits = torch.nn.functional.avg_pool2d(fine, 2)
        count = len(boxes)
        return SimpleNamespace(
            pred_masks=logits[None, :, None],
            iou_scores=torch.full((1, count, 1), 0.95),
            object_score_logits=torch.full((1, count, 1), 6.0),
        )

    def _mask(self, owner: np.ndarray, box: np.ndarray) -> np.ndarray:
        if self.everything:
            return np.ones_like(owner, bool)
        best, chosen = -1.0, np.zeros_like(owner, bool)
        for index in range(len(self.truth.bodies)):
            mask = owner == index
            if not mask.any():
                continue
            row, column = np.nonzero(mask)
            own = np.array([column.min(), row.min(), column.max() + 1, row.max() + 1], float)
            overlap = _overlap(own, box)
            if overlap > best:
                best, chosen = overlap, mask
        return chosen


def _overlap(a: np.ndarray, b: np.ndarray) -> float:
    sides = np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0)
    both = float(sides.prod())
    return both / max(float((a[2:] - a[:2]).prod() + (b[2:] - b[:2]).prod()) - both, 1e-12)
