"""Define how long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the finished share (0..1) and a few words on what is being done."""

AS_BEFORE = -1.0
"""A share that says: as far as before. Who only knows what is being done tells that."""


def silent(share: float, doing: str) -> None:
    """Ignore progress."""
