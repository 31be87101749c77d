"""The point-conditional classifier (paper, section 3.3): transformer over scene and object.

Scene tokens and object tokens share a space (coordinate and type embeddings) and attend to each
other; every point asked about attends to all tokens and to no other point, so that it can be
asked in any company.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import AROUND, OBJECT, OWN

SCENE, OBJECT_TYPE, POINT = 0, 1, 2
_FIRST_SHARPNESS = (0.0, 2.0, 8.0, 32.0)
"""How much each head favours near tokens at first: the factor of the squared distance."""


class PointClassifier(nn.Module):
    """Tell the object's points from the background's."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        width = config.width
        waves = 6 * config.frequencies
        points = OWN + AROUND if config.geometric else 3
        objects = OBJECT if config.geometric else 3
        self.embed_point = _mlp(points + waves, width, width)
        self.embed_object = _mlp(objects + waves, width, width)
        self.gather = _mlp(points + waves, width, width)
        self.kind = nn.Embedding(3, width)
        self.token_blocks = nn.ModuleList(NearBlock(config) for _ in range(config.token_layers))
        self.point_blocks = nn.ModuleList(NearBlock(config) for _ in range(config.point_layers))
        self.norm_tokens = nn.LayerNorm(width)
        self.norm_points = nn.LayerNorm(width)
        self.head = nn.Linear(width, 1)

    def tokens(
        self, context: Tensor, token: Tensor, assigned: Tensor, condition: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return the tokens (batch, m + k, width) and their places.

        Args:
            context: features of the context points (batch, c, f).
            token: indices of the scene tokens among them (batch, m).
            assigned: each context point's token (batch, c).
            condition: features of the object tokens (batch, k, g).
        """
        batch = torch.arange(len(context), device=context.device)[:, None]
        chosen = context[batch, token]
        scene = self.embed_point(self._read(chosen, self._points)) + self.kind.weight[SCENE]
        belongs = F.one_hot(assigned, token.shape[1]).to(context.dtype)
        share = belongs / belongs.sum(dim=1, keepdim=True).clamp(min=1)
        scene = scene + share.transpose(1, 2) @ self.gather(self._read(context, self._points))
        objects = self.embed_object(self._read(condition, self._objects))
        objects = objects + self.kind.weight[OBJECT_TYPE]
        tokens = torch.cat([scene, objects], dim=1)
        places = torch.cat([chosen[..., :3], condition[..., :3]], dim=1)
        for block in self.token_blocks:
            tokens = block(tokens, places, tokens, places)
        return self.norm_tokens(tokens), places

    def forward(self, points: Tensor, tokens: Tensor, places: Tensor) -> Tensor:
        """Return the logits (batch, n) of points by their features (batch, n, f)."""
        asked = self.embed_point(self._read(points, self._points)) + self.kind.weight[POINT]
        for block in self.point_blocks:
            asked = block(asked, points[..., :3], tokens, places)
        logits: Tensor = self.head(self.norm_points(asked))[..., 0]
        return logits

    def scene_logits(self, tokens: Tensor) -> Tensor:
        """Return the logits of the scene tokens themselves (for training)."""
        scene = tokens[:, : tokens.shape[1] - self.config.object_tokens]
        logits: Tensor = self.head(scene)[..., 0]
        return logits

    @property
    def _points(self) -> int:
        return OWN + AROUND if self.config.geometric else 3

    @property
    def _objects(self) -> int:
        return OBJECT if self.config.geometric else 3

    def _read(self, features: Tensor, used: int) -> Tensor:
        """Return the features that this network uses, with the coordinates as waves."""
        octave = 2.0 ** torch.arange(self.config.frequencies, device=features.device)
        angle = (features[..., :3, None] * octave * (torch.pi / 2)).flatten(-2)
        return torch.cat([features[..., :used], angle.sin(), angle.cos()], dim=-1)


class NearBlock(nn.Module):
    """Attention that favours near tokens, then an MLP, each on normalised input."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        width = config.width
        self.heads = config.heads
        self.norm_asking = nn.LayerNorm(width)
        self.norm_asked = nn.LayerNorm(width)
        self.query = nn.Linear(width, width)
        self.key_value = nn.Linear(width, 2 * width)
        self.out = nn.Linear(width, width)
        self.norm_mlp = nn.LayerNorm(width)
        self.mlp = _mlp(width, 2 * width, width)
        first = torch.tensor([_FIRST_SHARPNESS[k % 4] for k in range(config.heads)])
        self.sharpness = nn.Parameter(first.clamp(min=0.05).log())

    def forward(self, asking: Tensor, here: Tensor, asked: Tensor, there: Tensor) -> Tensor:
        """Return what asks, enriched by what is asked; ``here`` and ``there`` are places."""
        query = self._split(self.query(self.norm_asking(asking)))
        key, value = self.key_value(self.norm_asked(asked)).chunk(2, dim=-1)
        seen = near_attention(
            query, self._split(key), self._split(value), here, there, self.sharpness.exp()
        )
        asking = asking + self.out(seen.transpose(1, 2).flatten(2))
        mixed: Tensor = asking + self.mlp(self.norm_mlp(asking))
        return mixed

    def _split(self, values: Tensor) -> Tensor:
        return values.unflatten(-1, (self.heads, -1)).transpose(1, 2)


def near_attention(
    query: Tensor, key: Tensor, value: Tensor, here: Tensor, there: Tensor, sharpness: Tensor
) -> Tensor:
    """Return softmax(q k / sqrt(d) - sharpness |here - there|^2) v by heads.

    The distance is folded into the dot product by four more dimensions (what is equal for all
    tokens falls out of the softmax), so no matrix of distances is made.

    ``query`` is (batch, heads, n, d), ``key`` and ``value`` (batch, heads, t, d); ``here``
    (batch, n, 3) and ``there`` (batch, t, 3) are the places of who asks and who is asked;
    ``sharpness`` is one factor a head.
    """
    factor = sharpness[None, :, None, None]
    here, there = here[:, None], there[:, None]
    ones = torch.ones_like(here[..., :1]).expand(-1, len(sharpness), -1, -1)
    squared = -factor * there.square().sum(dim=-1, keepdim=True)
    longer = torch.cat([query / query.shape[-1] ** 0.5, 2 * factor * here, ones], dim=-1)
    wider = torch.cat([key, there.expand(-1, len(sharpness), -1, -1), squared], dim=-1)
    # The fused kernel wants all three equally wide; it makes no matrix of weights.
    padded = F.pad(value, (0, longer.shape[-1] - value.shape[-1]))
    seen = F.scaled_dot_product_attention(longer, wider, padded, scale=1.0)
    return seen[..., : value.shape[-1]]


def _mlp(inner: int, hidden: int, outer: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inner, hidden), nn.GELU(), nn.Linear(hidden, outer))
