"""Values to store, of every shape that the codec knows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np


@dataclass(frozen=True)
class Scale:
    source: Literal["prior", "unknown"] = "unknown"
    factor: float = 1.0


@dataclass(frozen=True)
class View:
    photo: str
    rgb: np.ndarray
    K: np.ndarray
    size: tuple[int, int] = (4, 3)


@dataclass(frozen=True)
class Scene:
    SCHEMA: ClassVar[str] = "test.Scene/1"
    views: tuple[View, ...]
    masks: tuple[np.ndarray, ...]
    points: np.ndarray
    scale: Scale | None
    scores: dict[str, float]
    counts: dict[str, int]
    notes: tuple[str, ...] = ()
    report: str = ""
    blob: bytes = b""
    table: Any = None
    best: np.ndarray = field(default_factory=lambda: np.zeros(0))


def scene(seed: int = 0, views: int = 3) -> Scene:
    """Return a scene with every kind of field."""
    rng = np.random.default_rng(seed)
    return Scene(
        views=tuple(
            View(f"{i}.jpg", rng.integers(0, 255, (3, 4, 3), dtype=np.uint8), np.eye(3) * i)
            for i in range(views)
        ),
        masks=tuple(rng.random((3 + i, 4)) > 0.5 for i in range(views)),
        points=rng.random((17, 3)).astype(np.float32),
        scale=Scale("prior", 2.5),
        scores={"iou": 0.5, "gap": float("inf")},
        counts={"a": 1, "b/c d": 2},
        notes=("one", ""),
        report="<html>" + "x" * 6000,
        blob=bytes(range(256)),
    )


def same(a: Any, b: Any) -> bool:
    """Tell whether two values are alike in types, shapes, element types and bits."""
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        equal = a.dtype == b.dtype and a.shape == b.shape
        return bool(equal and a.tobytes() == b.tobytes())
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    if hasattr(a, "__dataclass_fields__"):
        return all(same(getattr(a, k), getattr(b, k)) for k in a.__dataclass_fields__)
    return repr(a) == repr(b)
