"""Hold the settings of the Gravity-View decoder (light to import)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from garden_models.scene import BadInput

DA3_GIANT_WIDTH = 3072
"""Size of Depth-Anything-3 Giant's camera tokens."""


@dataclass(frozen=True)
class DecoderConfig:
    """Sizes of the network; the paper's (supplement A) are the defaults.

    ``positions`` are what the rotary encoding turns by: ``order`` is a view's place counted
    from the reference view's, ``reference`` only tells the reference view from all others, so
    that the order of the photos does not matter. ``tokens`` names what the network reads.
    """

    token_width: int = DA3_GIANT_WIDTH
    tokens: str = "da3-giant"
    width: int = 512
    blocks: int = 5
    heads: int = 8
    mlp_ratio: int = 4
    feature: int = 1536
    head: int = 512
    positions: Literal["order", "reference"] = "order"
    uncertain: bool = False
    """Whether the head also says how sure it is (the paper's does not)."""

    def __post_init__(self) -> None:
        if self.width % (2 * self.heads):
            raise BadInput(
                f"a decoder of width {self.width} cannot be split into {self.heads} heads of an "
                "even size, which the rotary encoding needs"
            )
        if self.positions not in ("order", "reference"):
            raise BadInput(f"positions is {self.positions!r}: use 'order' or 'reference'")


PAPER = DecoderConfig()
