"""Look at what this machine has of each model: code, weights, device, and what is missing."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from garden_models import foundation
from garden_models.foundation.model_card import ModelCard, Terms
from garden_models.scene import BadInput
from storage.digest import digest_value
from tasks.model.settings import ModelSettings, device_of, model_settings
from tasks.model.variant import variant_of
from tasks.model.weights import weights_of
from tasks.model.worker_start import interpreter

_LOOKING_S = 60
_DIGITS = 15
_FIND = "import importlib.util as u, sys; print(*[n for n in sys.argv[1:] if not u.find_spec(n)])"


@dataclass(frozen=True)
class FoundModel:
    """What this machine has of one model; ``problems`` say what to do about each gap.

    ``digest`` identifies the weights, empty if they are not whole. ``variant`` is what the
    weight folder says it holds.
    """

    card: ModelCard
    state: Literal["ready", "absent", "broken"]
    weights: Path | None
    variant: str | None
    terms: Terms
    digest: str
    device: str
    environment: str
    problems: tuple[str, ...]


def found_model(name: str) -> FoundModel:
    """Return what there is of a model; one without a folder of weights is ``absent``."""
    card = foundation.card(name)
    try:
        settings = model_settings(name)
    except BadInput as error:
        return FoundModel(card, "broken", None, None, card.terms, "", "", "", (str(error),))
    problems = list(_missing_code(card, settings))
    digest = device = ""
    try:
        digest = digest_value(weights_of(name), domain="model weights")[:_DIGITS]
    except BadInput as error:
        problems.append(str(error))
    try:
        device = device_of(name, settings)
    except BadInput as error:
        problems.append(str(error))
    variant = variant_of(card, settings.weights)
    return FoundModel(
        card=card,
        state="ready" if not problems else "broken" if settings.weights.exists() else "absent",
        weights=settings.weights,
        variant=variant,
        terms=card.terms_of(variant),
        digest=digest,
        device=device,
        environment=" ".join(interpreter(settings.python, settings.weights)),
        problems=tuple(problems),
    )


def _missing_code(card: ModelCard, settings: ModelSettings) -> tuple[str, ...]:
    """Say which modules the model's environment lacks."""
    if settings.python is None:
        missing = [module for module in card.imports if find_spec(module) is None]
    else:
        words = interpreter(settings.python, settings.weights)
        try:
            looked = subprocess.run(
                [*words, "-c", _FIND, *card.imports],
                capture_output=True,
                text=True,
                timeout=_LOOKING_S,
                check=True,
            )
        except (OSError, subprocess.SubprocessError) as error:
            return (f"its environment {' '.join(words)} does not run: {error}",)
        missing = looked.stdout.split()
    if not missing:
        return ()
    remedy = card.install or f"install it from {card.source}"
    return (f"its code is missing ({', '.join(missing)}): {remedy}",)
