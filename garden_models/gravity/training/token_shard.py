"""Keep a backbone's camera tokens of scenes with the true Gravity-View of their views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from garden_models.scene import BadInput


@dataclass(frozen=True)
class TokenShard:
    """Tokens of scenes, their views one after the other; scene k owns the views
    ``start[k]:start[k + 1]`` and its backbone took view ``reference[k]`` of them for reference.

    ``kind`` names the backbone, ``gv_from_camera`` are the true rotations of all views.
    """

    SCHEMA: ClassVar[str] = "garden.TokenShard/1"
    kind: str
    tokens: Float[np.ndarray, "v c"]
    gv_from_camera: Float[np.ndarray, "v 3 3"]
    reference: Int[np.ndarray, " scenes"]
    start: Int[np.ndarray, " scenes_1"]

    def __len__(self) -> int:
        return len(self.reference)

    @property
    def views(self) -> Int[np.ndarray, " scenes"]:
        """The number of views of each scene."""
        return np.diff(self.start)


def joined(shards: tuple[TokenShard, ...]) -> TokenShard:
    """Return shards as one. Raises BadInput if they are of different backbones."""
    kinds = sorted({f"{s.kind} of {s.tokens.shape[1]} entries" for s in shards})
    if len(kinds) != 1:
        raise BadInput(f"tokens of one training must be of one kind, not {' and '.join(kinds)}")
    views = np.concatenate([s.views for s in shards])
    return TokenShard(
        shards[0].kind,
        np.concatenate([s.tokens for s in shards]),
        np.concatenate([s.gv_from_camera for s in shards]),
        np.concatenate([s.reference for s in shards]),
        np.concatenate([[0], np.cumsum(views)]),
    )


def check_shard(shard: TokenShard, kind: str, width: int) -> None:
    """Raise BadInput for tokens that a network of ``kind`` and ``width`` cannot read."""
    if shard.kind != kind or shard.tokens.shape[1] != width:
        raise BadInput(
            f"these are tokens of {shard.kind} with {shard.tokens.shape[1]} entries; the network "
            f"reads tokens of {kind} with {width}: extract them again or change the preset"
        )
    if not np.isfinite(shard.tokens).all():
        bad = int(np.flatnonzero(~np.isfinite(shard.tokens).all(axis=1))[0])
        scene = int(np.searchsorted(shard.start, bad, side="right")) - 1
        raise BadInput(f"the tokens of scene {scene} have values that are not finite")
