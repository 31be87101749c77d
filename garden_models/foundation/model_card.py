"""State what a model needs and what it may be used for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class Terms:
    """The licences of code and weights; ``commercial`` tells whether both allow such use."""

    code: str
    weights: str
    commercial: bool


@dataclass(frozen=True)
class WeightFile:
    """A file, or with a trailing slash a folder, that belongs into a model's weight folder."""

    path: str
    note: str = ""
    """Where it comes from, as far as its name does not say."""


@dataclass(frozen=True)
class ModelCard:
    """One model. Some come in variants whose terms differ: their weight folder's
    ``config.json`` names the variant under ``variant_key``.
    """

    name: str
    title: str
    source: str
    """Where its code is published."""

    stage: Literal["reconstruct", "gravity", "targets", "segment", "mesh", "place"]
    terms: Terms
    """Of the model; of the strictest variant if there are any."""

    weights: tuple[WeightFile, ...]
    imports: tuple[str, ...]
    """Modules that must be importable in the model's environment."""

    devices: tuple[Literal["cpu", "cuda"], ...] = ("cpu", "cuda")
    install: str = ""
    """How to get the code, in one line."""

    bfloat16: bool = True
    """Whether it may run at this precision (torch's autocast)."""

    own_process: bool = False
    """Whether its code changes the process that it runs in, for all that runs beside it."""

    variant_key: str = ""
    variants: dict[str, Terms] = field(default_factory=dict)

    def terms_of(self, variant: str | None) -> Terms:
        """Return a variant's terms; the strictest for one that is not known."""
        return self.variants.get(variant or "", self.terms)
