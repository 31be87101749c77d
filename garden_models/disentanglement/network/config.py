"""Hold the settings of the point classifier network (light to import)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes of the network.

    ``geometric``: points carry their exact distance to the condition's triangles, the shape of
    their surroundings and of their cluster; without it they carry coordinates only, as the
    paper's do.
    """

    geometric: bool = True
    width: int = 96
    heads: int = 4
    token_layers: int = 3
    """Self-attention among scene and object tokens."""
    point_layers: int = 2
    """Cross-attention from points to tokens."""
    scene_tokens: int = 192
    object_tokens: int = 96
    frequencies: int = 6
    """Of the coordinate embedding: octaves from one wave over two object sizes."""


PAPER = NetworkConfig(
    geometric=False,
    width=256,
    heads=8,
    token_layers=6,
    point_layers=3,
    scene_tokens=512,
    object_tokens=256,
    frequencies=8,
)
"""The paper's inputs, coordinates and type, at a size that it does not state."""
