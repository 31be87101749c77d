"""Another model for the same device."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from tests.tasks.model import doubler
from tests.tasks.model.nouns import Ask

CARD = dataclasses.replace(doubler.CARD, name="tripler", devices=("cpu",), bfloat16=False)


def load(weights: Path, device: str) -> Ask:
    return doubler.load(weights, device)
