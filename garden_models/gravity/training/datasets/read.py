"""Read a data set by its name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from garden_models.gravity.training.datasets.hypersim import read_hypersim
from garden_models.gravity.training.datasets.sequence import PosedSequence
from garden_models.gravity.training.datasets.tartanair import read_tartanair
from garden_models.gravity.training.datasets.vkitti2 import read_vkitti2
from garden_models.scene import BadInput

READERS: dict[str, Callable[[Path], list[PosedSequence]]] = {
    "tartanair": read_tartanair,
    "hypersim": read_hypersim,
    "vkitti2": read_vkitti2,
}


def read_dataset(name: str, root: Path) -> list[PosedSequence]:
    """Return a data set's sequences. Raises BadInput for an unknown name or a wrong folder."""
    if name not in READERS:
        raise BadInput(f"no data set called {name!r}: use one of {', '.join(READERS)}")
    if not root.is_dir():
        raise BadInput(f"no such folder: {root}")
    return READERS[name](root)
