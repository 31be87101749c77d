"""Tell which variant of a model a machine has."""

from __future__ import annotations

import json
from pathlib import Path

from garden_models.foundation.model_card import ModelCard


def variant_of(card: ModelCard, weights: Path) -> str | None:
    """Return which variant a weight folder holds, None if it does not say."""
    if not card.variant_key:
        return None
    try:
        document = json.loads((weights / "config.json").read_text("utf-8"))
    except (OSError, ValueError):
        return None
    value = document.get(card.variant_key) if isinstance(document, dict) else None
    return value if isinstance(value, str) else None
