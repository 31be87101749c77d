"""Gravity from a reconstruction: cues and baselines by name, and their fusion.

A method is a file of this room with ``estimate(reconstruction) -> GravityEvidence | None``;
a cue also has ``read(reconstruction) -> Cue | None``. Adding one is a file and a line here.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from garden_models.gravity.protocol import Cue, Method
    from garden_models.scene import GravityEvidence, Reconstruction

NAMES = (
    "planes",
    "vanishing_points",
    "camera_x_axes",
    "plane_ransac",
    "normal_clustering",
    "manhattan_frame",
    "mean_camera_up",
    "view_decoder",
)
TRAINED = ("view_decoder",)
"""Methods that read a checkpoint."""


def _method(name: str) -> Method:
    def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
        found: GravityEvidence | None = import_module(f"{__name__}.{name}").estimate(reconstruction)
        return found

    return estimate


METHODS: dict[str, Callable[[Reconstruction], GravityEvidence | None]] = {
    name: _method(name) for name in NAMES
}


def read_cue(name: str, reconstruction: Reconstruction, weights: str = "") -> Cue | None:
    """Return a method's reading for fusion; a method of one answer is read as one mode.

    ``weights`` is the checkpoint of a trained method; the shipped one if not given. Raises
    BadInput for a name that ``METHODS`` does not hold.
    """
    from garden_models.gravity.protocol import cue_of_evidence
    from garden_models.scene import BadInput

    if name not in METHODS:
        raise BadInput(f"no gravity method is called {name!r}; there are {', '.join(METHODS)}")
    module = import_module(f"{__name__}.{name}")
    if name in TRAINED:
        trained: Cue | None = module.read(reconstruction, weights)
        return trained
    if hasattr(module, "read"):
        cue: Cue | None = module.read(reconstruction)
        return cue
    evidence = METHODS[name](reconstruction)
    return None if evidence is None else cue_of_evidence(evidence)
