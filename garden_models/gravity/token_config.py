"""Configure gravity from a geometry model's camera tokens."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class TokenGravity:
    """``weights`` is the checkpoint of a decoder trained on the model's camera tokens (`garden
    train gravity`); none is asked if empty.
    """

    weights: str = ""
