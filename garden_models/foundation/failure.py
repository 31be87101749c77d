"""Say how a model can fail that was asked rightly: it has no room, or gives no answer."""

from __future__ import annotations


class ModelOutOfMemory(MemoryError):
    """A model needs more memory than there is; half as many photos at once may fit."""


class ModelFailed(RuntimeError):
    """A model gave no usable answer; the message names it and says what it did."""
