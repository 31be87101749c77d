"""State what a model needs and what it may be used for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class WeightFile:
    """A file, or with a trailing slash a folder, that belongs into a model's weight folder."""

    path: str
    note: str = ""
    """Where it comes from, as far as its name does not say."""


@dataclass(frozen=True)
class ModelCard:
    """One model. ``commercial`` tells whether code and weights both allow commercial use."""

    name: str
    title: str
    source: str
    """Where its code is published."""

    stage: Literal["reconstruct", "gravity", "targets", "segment", "mesh", "place"]
    code_licence: str
    weights_licence: str
    commercial: bool
    weights: tuple[WeightFile, ...]
    imports: tuple[str, ...]
    """Modules that must be importable in the model's environment."""

    devices: tuple[Literal["cpu", "cuda"], ...] = ("cpu", "cuda")
    install: str = ""
    """How to get the code, in one line."""
