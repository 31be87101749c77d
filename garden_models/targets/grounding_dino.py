"""GroundingDINO: find named things in a photo (transformers' implementation).

Its boxes are (centre x, centre y, width, height) in shares of the photo; its logits score
each box against each token of a text in which every name ends with a full stop.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from PIL import Image
from safetensors import SafetensorError

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from garden_models.scene import BadInput
from garden_models.targets.grounding_model import GroundingAnswer, GroundingRequest, GroundLabels

SHORT_SIDE, LONG_SIDE = 800, 1333
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)

CARD = ModelCard(
    name="grounding_dino",
    title="GroundingDINO (tiny or base)",
    source="https://github.com/IDEA-Research/GroundingDINO",
    stage="targets",
    terms=Terms("Apache-2.0", "Apache-2.0", commercial=True),
    weights=(
        WeightFile("config.json", "from IDEA-Research/grounding-dino-tiny or -base"),
        WeightFile("model.safetensors"),
        WeightFile("tokenizer.json"),
        WeightFile("tokenizer_config.json"),
    ),
    imports=("transformers",),
    install="pip install 'garden-scenes[foundation]'",
)


def load(weights: Path, device: str) -> GroundLabels:
    """Return the model of a weight folder.

    Raises BadInput if transformers or a file is missing, or if the weights do not fit.
    """
    network, tokenizer = _network(weights, device), _tokenizer(weights)

    def ground(request: GroundingRequest) -> GroundingAnswer:
        text, spans = text_of(request.labels)
        tokens = tokenizer(text, return_tensors="pt", return_offsets_mapping=True)
        offsets = tokens.pop("offset_mapping")[0].numpy()
        if len(offsets) > network.config.max_text_len:
            raise BadInput(
                f"{len(request.labels)} labels are {len(offsets)} tokens, and GroundingDINO reads "
                f"{network.config.max_text_len}: look for fewer at once"
            )
        pixels = torch.from_numpy(prepared(request.rgb))[None].to(device)
        mask = torch.ones(pixels.shape[0], *pixels.shape[2:], dtype=torch.long, device=device)
        found = network(pixel_values=pixels, pixel_mask=mask, **tokens.to(device))
        return answer_of(
            found.logits[0].float().sigmoid().cpu().numpy(),
            found.pred_boxes[0].float().cpu().numpy(),
            tokens_of_labels(offsets, spans),
            request,
        )

    return ground


def text_of(labels: tuple[str, ...]) -> tuple[str, list[tuple[int, int]]]:
    """Return the text that names all labels, and from where to where each stands in it."""
    text, spans = "", []
    for label in labels:
        words = " ".join(label.lower().split())
        start = len(text)
        spans.append((start, start + len(words)))
        text += f"{words}. "
    return text.strip(), spans


def tokens_of_labels(offsets: np.ndarray, spans: list[tuple[int, int]]) -> list[list[int]]:
    """Return the indices of each label's tokens; ``offsets`` are the tokens' places."""
    return [
        [i for i, (a, b) in enumerate(offsets) if a < b and start <= a and b <= end]
        for start, end in spans
    ]


def prepared(rgb: np.ndarray) -> Float[np.ndarray, "3 h w"]:
    """Return a photo as the network takes it: short side 800, long side 1333 at most."""
    height, width = rgb.shape[:2]
    size = resized(width, height)
    picture = Image.fromarray(rgb).resize(size, Image.Resampling.BILINEAR)
    pixels = np.asarray(picture, np.float32) / 255
    normal = (pixels - np.asarray(MEAN, np.float32)) / np.asarray(STD, np.float32)
    return np.ascontiguousarray(normal.transpose(2, 0, 1), np.float32)


def resized(width: int, height: int) -> tuple[int, int]:
    """Return (width, height) at which the network sees a photo."""
    short, long = min(width, height), max(width, height)
    to_short = float(SHORT_SIDE)
    if long / short * SHORT_SIDE > LONG_SIDE:
        to_short = LONG_SIDE * short / long
    across_long = int(to_short * long / short)
    across_short = round(to_short)
    return (across_short, across_long) if width < height else (across_long, across_short)


def answer_of(
    probability: Float[np.ndarray, "q t"],
    centred: Float[np.ndarray, "q 4"],
    tokens: list[list[int]],
    request: GroundingRequest,
) -> GroundingAnswer:
    """Return the boxes that score enough, each for the label that fits it best."""
    height, width = request.rgb.shape[:2]
    scores = np.stack([probability[:, t].max(1, initial=0.0) for t in tokens], 1)
    label = scores.argmax(1)
    best = scores[np.arange(len(scores)), label]
    order = np.argsort(-best, kind="stable")
    chosen = order[best[order] >= request.min_score]
    half = centred[chosen, 2:] / 2
    corners = np.concatenate([centred[chosen, :2] - half, centred[chosen, :2] + half], 1)
    boxes = np.clip(corners, 0, 1) * np.array([width, height, width, height])
    return GroundingAnswer(
        boxes.astype(np.float64), best[chosen].astype(np.float64), label[chosen].astype(np.int64)
    )


def _network(weights: Path, device: str) -> Any:
    transformers = _transformers()
    try:
        network, info = transformers.GroundingDinoForObjectDetection.from_pretrained(
            weights, local_files_only=True, output_loading_info=True
        )
    except (OSError, ValueError, RuntimeError, KeyError, SafetensorError) as error:
        raise BadInput(
            f"the weights in {weights} are not GroundingDINO's ({_line(error)}): put those of "
            "IDEA-Research/grounding-dino-tiny or -base there"
        ) from error
    wrong = [*info["missing_keys"], *info["unexpected_keys"], *info["mismatched_keys"]]
    if wrong:
        raise BadInput(
            f"the weights in {weights} do not fit their config.json ({wrong[0]} and "
            f"{len(wrong) - 1} more): put both files of one model there"
        )
    return network.to(device).float().eval()


def _tokenizer(weights: Path) -> Any:
    for name in ("tokenizer.json", "tokenizer_config.json"):
        if not (weights / name).is_file():
            raise BadInput(f"{weights / name} is missing: put the model's file there")
    try:
        return _transformers().AutoTokenizer.from_pretrained(weights, local_files_only=True)
    except (OSError, ValueError, KeyError) as error:
        raise BadInput(f"the tokenizer in {weights} cannot be read ({_line(error)})") from error


def _transformers() -> Any:
    try:
        return import_module("transformers")
    except ModuleNotFoundError as error:
        raise BadInput(f"GroundingDINO needs transformers: {CARD.install}") from error


def _line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0][:160]
