"""Collect the parts of ``make faults`` and what each counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Count:
    """How often one thing was broken on purpose, and every time an invariant did not hold."""

    what: str
    trials: int
    violations: tuple[str, ...] = ()


Part = Callable[[Path], Iterable[Count]]
PARTS: dict[str, Part] = {}


def part(name: str) -> Callable[[Part], Part]:
    """Register a function that gives counts; it works in the empty folder it is given."""

    def register(function: Part) -> Part:
        PARTS[name] = function
        return function

    return register
