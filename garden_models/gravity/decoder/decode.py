"""Decode gravity from evidence: several starts, a few rounds each, and how far they agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from garden_models.geometry.rotation import normalized
from garden_models.gravity.decoder.evidence import ViewEvidence
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.start_frame import frame_of, starts
from garden_models.gravity.decoder.tokens import EvidenceBatch, evidence_batch, view_tokens
from garden_models.scene import BadInput

Direction = Float[np.ndarray, "3"]

ROUNDS = 3
SAME = np.radians(4.0)
"""Answers from different starts this near are one answer."""
FAR = np.radians(30.0)
"""Disagreement beyond this counts as this much."""


@dataclass(frozen=True)
class Decoding:
    """``down_world`` with the claimed total sigma (radians, not calibrated), and the share of
    the starts (weighed by their claims) that led there; ``tokens`` are the last round's.
    """

    down_world: Direction
    claimed_rad: float
    agreement: float
    tokens: Float[np.ndarray, "views width"]


def decode(model: GravityViewDecoder, evidence: ViewEvidence) -> Decoding:
    """Return gravity. Raises BadInput for evidence that is not finite."""
    for name in ("rotation", "centre", "place", "normal", "line"):
        if not np.isfinite(getattr(evidence, name)).all():
            raise BadInput(f"the evidence for gravity ({name}) has values that are not finite")
    device = next(model.parameters()).device
    batch = evidence_batch([evidence]).to(device)
    downs = starts(evidence)
    with torch.inference_mode():
        for _ in range(ROUNDS):
            downs, sigma, _ = _round(model, batch, evidence, downs)
        best, agreement, claimed = _agreed(downs, sigma)
        _, _, tokens = _round(model, batch, evidence, best[None])
    return Decoding(best, claimed, agreement, tokens[0])


def _round(
    model: GravityViewDecoder, batch: EvidenceBatch, evidence: ViewEvidence, downs: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what each start's tokens say: directions down, claimed sigmas, the tokens."""
    reference = evidence.rotation[evidence.reference]
    frames = np.stack([frame_of(down, reference) for down in downs])
    many = EvidenceBatch(
        *(_repeat(getattr(batch, name), len(downs)) for name in EvidenceBatch.__annotations__)
    )
    tokens = view_tokens(many, torch.from_numpy(frames.astype(np.float32)).to(batch.scale.device))
    index = torch.full((len(downs),), evidence.reference, device=tokens.device)
    found = model(tokens, index)
    rotation = found.rotation.cpu().numpy().astype(np.float64)
    down = np.stack([normalized(r[1] @ f) for r, f in zip(rotation, frames, strict=True)])
    log_sigma = found.log_sigma
    sigma = np.full(len(downs), SAME) if log_sigma is None else log_sigma.exp().cpu().numpy()
    return down, sigma.astype(np.float64), tokens.cpu().numpy()


def _agreed(downs: np.ndarray, sigma: np.ndarray) -> tuple[Direction, float, float]:
    """Return the answer that most starts led to, their share, and its sigma with their spread."""
    trust = 1 / sigma**2
    trust = trust / trust.sum()
    angle = 2 * np.arcsin(np.clip(np.linalg.norm(downs[:, None] - downs, axis=-1) / 2, 0, 1))
    cost = np.minimum(angle, FAR) ** 2 @ trust
    middle = int(np.argmin(cost))
    near = angle[middle] < SAME
    down = normalized((trust * near) @ downs)
    # Other answers count by their trust, so one that is sure of itself makes all unsure.
    own = float((trust * near) @ sigma**2 / (trust @ near))
    return down, float(trust @ near), float(np.sqrt(own + cost[middle]))


def _repeat(values: Tensor, count: int) -> Tensor:
    return values.expand(count, *values.shape[1:])
