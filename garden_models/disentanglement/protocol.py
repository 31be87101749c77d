"""Define what every point classifier is given and gives back (paper, section 3.3).

A classifier is asked about the scene points in a relaxed box around one placed object mesh
and returns, for each, the probability that it belongs to the object. Adding a method is one
file with a ``classify`` function and one line in ``METHODS``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module

import numpy as np
from jaxtyping import Bool, Float, Int

from garden_models.progress import Progress
from garden_models.scene import BadInput, PointCloud, SupportSurface


@dataclass(frozen=True)
class PlacedMesh:
    """The object's closed mesh at its placement in GV, metres."""

    vertices_gv: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]

    @property
    def size(self) -> float:
        """Longest extent in metres."""
        return float(np.ptp(self.vertices_gv, axis=0).max())


@dataclass(frozen=True)
class ViewEvidence:
    """One photo's depth (metres, 0 = none) and the object's mask in it."""

    K: Float[np.ndarray, "3 3"]
    camera_from_gv: Float[np.ndarray, "4 4"]
    depth: Float[np.ndarray, "h w"]
    mask: Bool[np.ndarray, "h w"]


@dataclass(frozen=True)
class Crop:
    """Everything that is known about the points around one object."""

    points_gv: PointCloud
    mesh: PlacedMesh
    views: tuple[ViewEvidence, ...]
    support: SupportSurface | None


Classifier = Callable[[Crop, Progress], Float[np.ndarray, " n"]]
"""Returns each point's probability (0..1) of being part of the object."""

METHODS: dict[str, str] = {
    "geometric": "garden_models.disentanglement.geometric_rule:classify",
    "network": "garden_models.disentanglement.network.classify:classify",
}
TRAINED = ("network",)
"""Methods that take a checkpoint (``weights``, a path)."""


def classifier(method: str, weights: str = "") -> Classifier:
    """Return a classifier by name, importing it only now.

    Raises BadInput if it is unknown, or if it takes no ``weights`` and some are given.
    """
    if method not in METHODS:
        raise BadInput(
            f"unknown disentanglement method {method!r}: choose one of {', '.join(METHODS)}"
        )
    if weights and method not in TRAINED:
        raise BadInput(
            f"the disentanglement method {method!r} takes no weights: set disentangle.method to "
            f"one of {', '.join(TRAINED)}"
        )
    module, function = METHODS[method].split(":")
    found = getattr(import_module(module), function)
    chosen: Classifier = partial(found, weights=weights) if weights else found
    return chosen
