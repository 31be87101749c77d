"""Extract Depth-Anything-3's camera tokens and its reference view (the decoder's input).

The token of a view is what its camera decoder reads: the class token of the last layer, local
and global halves joined, not normalised. Photos are prepared as the model's own code does it.
"""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from jaxtyping import Float, UInt8

from garden_models.scene import BadInput

LONG_SIDE, PATCH = 504, 14
MEAN, STD = np.array([0.485, 0.456, 0.406]), np.array([0.229, 0.224, 0.225])
STRATEGY = "saddle_balanced"
FEWEST_TO_CHOOSE = 3
"""With fewer views the first one is the reference."""

Photo = UInt8[np.ndarray, "h w 3"]


def prepare(photos: list[Photo]) -> Float[np.ndarray, "n 3 h w"]:
    """Return photos as the backbone reads them: long side 504, sides multiples of 14, ImageNet
    statistics, cut to the smallest of them about the middle.
    """
    resized = [_resized(photo) for photo in photos]
    height = min(photo.shape[0] for photo in resized)
    width = min(photo.shape[1] for photo in resized)
    cut = []
    for photo in resized:
        top, left = (photo.shape[0] - height) // 2, (photo.shape[1] - width) // 2
        cut.append(photo[top : top + height, left : left + width])
    normal = (np.stack(cut).astype(np.float32) / 255 - MEAN) / STD
    return normal.transpose(0, 3, 1, 2).astype(np.float32)


def _resized(photo: Photo) -> Photo:
    height, width = photo.shape[:2]
    factor = LONG_SIDE / max(height, width)
    sides = [max(PATCH, int(np.floor(s * factor / PATCH + 0.5)) * PATCH) for s in (width, height)]
    method = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(photo, (sides[0], sides[1]), interpolation=method), np.uint8)


def load_backbone(folder: Path, device: str) -> tuple[Any, str]:
    """Return Depth-Anything-3's network of a weight folder and its name (``da3-giant``).

    Raises BadInput if a file or the package is missing, or the weights do not fit.
    """
    try:
        name = str(json.loads((folder / "config.json").read_text("utf-8"))["model_name"])
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"{folder}: no config.json with a model_name ({error})") from error
    try:
        cfg = importlib.import_module("depth_anything_3.cfg")
        registry = importlib.import_module("depth_anything_3.registry").MODEL_REGISTRY
    except ImportError as error:
        raise BadInput(
            "Depth-Anything-3 is not installed: pip install --no-deps depth-anything-3, with "
            "omegaconf, addict and einops"
        ) from error
    from safetensors.torch import load_file

    if name not in registry:
        raise BadInput(f"{folder}: Depth-Anything-3 has no model called {name}")
    net = cfg.create_object(cfg.load_config(registry[name])).eval()
    weights = load_file(folder / "model.safetensors")
    try:
        net.load_state_dict({k.removeprefix("model."): w for k, w in weights.items()}, strict=True)
    except RuntimeError as error:
        raise BadInput(f"{folder}: the weights do not fit {name}: {error}") from error
    return net.to(device), name


def camera_tokens(net: Any, photos: list[Photo]) -> tuple[Float[np.ndarray, "n c"], int]:
    """Return one token a photo, in their order, and the index of the reference view."""
    vision = importlib.import_module("depth_anything_3.model.dinov2.vision_transformer")
    device = next(net.parameters()).device
    pictures = torch.from_numpy(prepare(photos))[None].to(device)
    vit = net.backbone.pretrained
    seen: list[torch.Tensor] = []
    layer = vit.blocks[vit.alt_start - 2]
    hook = layer.register_forward_hook(lambda _module, _inputs, out: seen.append(out))
    try:
        with torch.inference_mode():
            features, _ = net.backbone(
                pictures, cam_token=None, export_feat_layers=[], ref_view_strategy=STRATEGY
            )
    finally:
        hook.remove()
    reference = 0
    if len(photos) >= FEWEST_TO_CHOOSE:
        before = seen[0].reshape(1, len(photos), *seen[0].shape[-2:])
        reference = int(vision.select_reference_view(before, STRATEGY)[0])
    return features[-1][1][0].float().cpu().numpy(), reference
