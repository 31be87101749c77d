"""Register the families of procedural shapes and make their members."""

from __future__ import annotations

import functools

import numpy as np

from garden_models.disentanglement.training.shapes import (
    cabinets,
    household,
    seating,
    tables,
    tableware,
)
from garden_models.disentanglement.training.shapes.shape import Family, Shape, finish

FURNITURE: dict[str, Family] = {**tables.FAMILIES, **seating.FAMILIES, **cabinets.FAMILIES}
"""Families that stand on the floor."""

SMALL: dict[str, Family] = {**tableware.FAMILIES, **household.FAMILIES}
"""Families that stand on furniture (and sometimes on the floor)."""

FAMILIES = {**FURNITURE, **SMALL}

_SCALE = (0.85, 1.15)


@functools.lru_cache(maxsize=4096)
def make_shape(family: str, member: int) -> Shape:
    """Return one member of a family; the same numbers give the same shape for ever.

    Raises KeyError for an unknown family.
    """
    index = sorted(FAMILIES).index(family) if family in FAMILIES else -1
    if index < 0:
        raise KeyError(f"no family of shapes called {family!r}")
    rng = np.random.default_rng((index, member))
    draft = FAMILIES[family](rng)
    stretch = rng.uniform(*_SCALE, 3)
    parts = [part.scaled(*stretch) for part in draft.parts]
    shelves = [
        type(s)(
            s.height * stretch[1],
            (s.x[0] * stretch[0], s.x[1] * stretch[0]),
            (s.z[0] * stretch[2], s.z[1] * stretch[2]),
            s.clearance * stretch[1],
        )
        for s in draft.shelves
    ]
    return finish(type(draft)(parts, shelves), f"{family}/{member}", family)
