"""Measure all models that are asked for, with all numbers of photos."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

from flows.benchmark.models.measure import Measured, measure
from flows.benchmark.models.questions import stages
from flows.benchmark.models.random_weights import MAKERS, random_weights
from flows.benchmark.models.report import ModelsReport
from garden_models import foundation
from garden_models.foundation.failure import ModelFailed, ModelOutOfMemory
from garden_models.scene import BadGeometry, BadInput
from tasks.model.found import found_model
from tasks.step import StepFailed

_KNOWN = (BadInput, BadGeometry, ModelFailed, ModelOutOfMemory, StepFailed)


def measure_all(
    *,
    names: tuple[str, ...],
    photos: tuple[int, ...],
    size: tuple[int, int],
    repeats: int,
    random: bool,
    variant: str | None,
    folder: Path,
    say: Callable[[str], None],
) -> ModelsReport:
    """Return what each model cost; one that does not run leaves the others alone.

    Raises WrongUse for random weights that cannot be made, BadInput for an unknown name.
    """
    chosen = names or _all(random)
    for name in chosen:
        foundation.card(name)
    measured: list[Measured] = []
    failed: dict[str, str] = {}
    given = random_weights(chosen, variant, folder / "weights") if random else nullcontext()
    with given:
        for name in chosen:
            for count in photos:
                say(f"{name}, {count} photos")
                place = folder / f"{name}-{count}"
                place.mkdir()
                try:
                    measured.append(measure(name, count, size, repeats, place))
                except _KNOWN as error:
                    failed[f"{name}, {count} photos"] = str(error)
                shutil.rmtree(place)
    return ModelsReport(size, random, tuple(measured), failed)


def _all(random: bool) -> tuple[str, ...]:
    """Return the models that can be measured here."""
    names = [n for n in foundation.ADAPTERS if foundation.card(n).stage in stages()]
    if random:
        return tuple(name for name in names if name in MAKERS)
    return tuple(name for name in names if found_model(name).state == "ready")
