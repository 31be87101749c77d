"""Define how long work tells how far it is."""

from collections.abc import Callable

Progress = Callable[[float, str], None]
"""Called with the finished share (0..1) and a few words on what is being done."""


def silent(share: float, doing: str) -> None:
    """Ignore progress."""
