"""Keep what a model's published code does to the process from lasting, or from happening."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch


@contextmanager
def first_on_path(folder: Path) -> Iterator[None]:
    """Let modules be found in a folder first, for code that is no package."""
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))


@contextmanager
def tensors_only() -> Iterator[None]:
    """Let ``torch.load`` read tensors and nothing that runs, whatever the code asks for.

    A file that holds more, or is damaged, is a ValueError.
    """
    plain = torch.load

    def careful(*args: Any, **kwargs: Any) -> Any:
        try:
            return plain(*args, **{**kwargs, "weights_only": True})
        except (OSError, MemoryError):
            raise
        except Exception as error:
            raise ValueError(f"a weight file cannot be read as tensors: {error}") from error

    torch.load = careful
    try:
        yield
    finally:
        torch.load = plain


@contextmanager
def usual_tensors() -> Iterator[None]:
    """Undo a change of the type that every new tensor of the process has."""
    try:
        yield
    finally:
        torch.set_default_tensor_type(torch.FloatTensor)
