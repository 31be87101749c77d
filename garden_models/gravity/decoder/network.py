"""The Gravity-View decoder (paper, section 3.1 and supplement A).

The reference view's token asks the tokens of all views; what it gathers becomes a rotation
from the reference view to Gravity-View.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.rotary import rotate

_IDENTITY_6D = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
_FIRST_LOG_SIGMA = -2.0
"""Near 8 degrees: what the network claims before it has learned anything."""


@dataclass(frozen=True)
class DecodedRotation:
    """``gv_from_reference`` (batch, 3, 3); ``log_sigma`` (batch,) of its angular error in
    radians, None if the network does not say.
    """

    rotation: Tensor
    log_sigma: Tensor | None


class GravityViewDecoder(nn.Module):
    """Decode view tokens into the rotation from the reference view to Gravity-View."""

    def __init__(self, config: DecoderConfig) -> None:
        super().__init__()
        self.config = config
        self.project_query = nn.Linear(config.token_width, config.width)
        self.project_context = nn.Linear(config.token_width, config.width)
        self.blocks = nn.ModuleList(DecoderBlock(config) for _ in range(config.blocks))
        self.norm = nn.LayerNorm(config.width)
        self.out = nn.Linear(config.width, config.feature)
        self.head = _mlp(config.feature, config.head, 6 + int(config.uncertain))
        last = self.head[-1]
        assert isinstance(last, nn.Linear)
        with torch.no_grad():
            last.weight.mul_(0.1)
            last.bias[:6] = torch.tensor(_IDENTITY_6D)
            last.bias[6:] = _FIRST_LOG_SIGMA

    def forward(
        self, tokens: Tensor, reference: Tensor, present: Tensor | None = None
    ) -> DecodedRotation:
        """Return the rotation from each scene's reference view to Gravity-View.

        Args:
            tokens: (batch, views, token_width).
            reference: (batch,) index of each scene's reference view.
            present: (batch, views) False where a scene has fewer views; all if not given.
        """
        row = torch.arange(len(tokens), device=tokens.device)
        if present is None:
            present = torch.ones(tokens.shape[:2], dtype=torch.bool, device=tokens.device)
        tokens = torch.where(present[..., None], tokens, torch.zeros_like(tokens))
        positions = self._positions(tokens.shape[1], reference)
        asking = self.project_query(tokens[row, reference])[:, None]
        context = self.project_context(tokens)
        for block in self.blocks:
            asking = block(asking, context, positions, present)
        values = self.head(self.out(self.norm(asking[:, 0])))
        sigma = values[:, 6] if self.config.uncertain else None
        return DecodedRotation(rotation_from_6d(values[:, :6]), sigma)

    def _positions(self, views: int, reference: Tensor) -> Tensor:
        """Return each view's position, the reference view's being 0."""
        order = torch.arange(views, device=reference.device)[None] - reference[:, None]
        return order if self.config.positions == "order" else (order != 0).long()


class DecoderBlock(nn.Module):
    """Self-attention, cross-attention to all views, MLP; each on normalised input, residual."""

    def __init__(self, config: DecoderConfig) -> None:
        super().__init__()
        width = config.width
        self.norm_self = nn.LayerNorm(width)
        self.self_attention = Attention(width, config.heads)
        self.norm_asking = nn.LayerNorm(width)
        self.norm_context = nn.LayerNorm(width)
        self.cross_attention = Attention(width, config.heads)
        self.norm_mlp = nn.LayerNorm(width)
        self.mlp = _mlp(width, config.mlp_ratio * width, width)

    def forward(
        self, asking: Tensor, context: Tensor, positions: Tensor, present: Tensor
    ) -> Tensor:
        """Return the asking token (batch, 1, width) after one block."""
        here = torch.zeros_like(positions[:, :1])
        alone = torch.ones_like(present[:, :1])
        own = self.norm_self(asking)
        asking = asking + self.self_attention(own, own, here, here, alone)
        asking = asking + self.cross_attention(
            self.norm_asking(asking), self.norm_context(context), here, positions, present
        )
        mixed: Tensor = asking + self.mlp(self.norm_mlp(asking))
        return mixed


class Attention(nn.Module):
    """Attention of several heads with rotary positions."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.query = nn.Linear(width, width)
        self.key_value = nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)

    def forward(
        self, asking: Tensor, asked: Tensor, here: Tensor, there: Tensor, present: Tensor
    ) -> Tensor:
        """Return what ``asking`` (b, n, w) gathers from those ``asked`` (b, m, w) present."""
        key, value = self.key_value(asked).chunk(2, dim=-1)
        query = rotate(self._split(self.query(asking)), here)
        key = rotate(self._split(key), there)
        seen = F.scaled_dot_product_attention(
            query, key, self._split(value), attn_mask=present[:, None, None, :]
        )
        gathered: Tensor = self.out(seen.transpose(1, 2).flatten(2))
        return gathered

    def _split(self, values: Tensor) -> Tensor:
        return values.unflatten(-1, (self.heads, -1)).transpose(1, 2)


def rotation_from_6d(six: Tensor) -> Tensor:
    """Orthonormalise two 3-vectors (..., 6) into the first two rows of rotations."""
    first = F.normalize(six[..., :3], dim=-1)
    along = (first * six[..., 3:]).sum(dim=-1, keepdim=True)
    second = F.normalize(six[..., 3:] - along * first, dim=-1)
    return torch.stack([first, second, torch.linalg.cross(first, second)], dim=-2)


def _mlp(inner: int, hidden: int, outer: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inner, hidden), nn.GELU(), nn.Linear(hidden, outer))
