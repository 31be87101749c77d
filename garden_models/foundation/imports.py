"""Import a model's published code, and find its files, or say what to do."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from garden_models.foundation.model_card import ModelCard
from garden_models.scene import BadInput


def import_code(card: ModelCard, module: str) -> Any:
    """Return a module of the model's environment; BadInput with how to get it."""
    try:
        return import_module(module)
    except ImportError as error:
        remedy = f": {card.install}" if card.install else f"; it is published at {card.source}"
        raise BadInput(
            f"{card.title} needs the Python module {module}, which cannot be imported here "
            f"({error}){remedy}"
        ) from error


def check_files(card: ModelCard, weights: Path) -> None:
    """Raise BadInput that names every file of the model that its weight folder lacks."""
    missing = [file for file in card.weights if not (weights / file.path).exists()]
    if missing:
        names = ", ".join(f"{f.path} ({f.note})" if f.note else f.path for f in missing)
        raise BadInput(f"{card.title} lacks {names} in {weights}: put them there ({card.source})")
