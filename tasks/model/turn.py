"""Choose whose turn it is on a device: the model that is loaded goes first, within a bound."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tasks.model.launch import Launch

MOST_OVERTAKEN = 64
"""How often questions to the loaded model may go before an older one to another model."""


class Waiting(Protocol):
    """A question that waits; ``overtaken`` counts the younger ones that went before it."""

    launch: Launch
    overtaken: int


def next_turn(waiting: Sequence[Waiting], loaded: Launch | None) -> int | None:
    """Return the place, in a queue with the oldest first, of who goes next; None if nobody waits.

    The oldest question to the loaded model, unless the oldest of all was overtaken too often.
    """
    if not waiting:
        return None
    if waiting[0].overtaken >= MOST_OVERTAKEN:
        return 0
    return next((i for i, w in enumerate(waiting) if w.launch == loaded), 0)


def overtake(waiting: Sequence[Waiting], chosen: int) -> None:
    """Count the turn for those who came before the chosen one."""
    for other in waiting[:chosen]:
        other.overtaken += 1
