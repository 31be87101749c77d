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

MODULES = {
    "planes": "garden_models.gravity.planes",
    "vanishing_points": "garden_models.gravity.vanishing_points",
    "camera_x_axes": "garden_models.gravity.camera_x_axes",
    "plane_ransac": "garden_models.gravity.plane_ransac",
    "normal_clustering": "garden_models.gravity.normal_clustering",
    "manhattan_frame": "garden_models.gravity.manhattan_frame",
    "mean_camera_up": "garden_models.gravity.mean_camera_up",
    "reference_camera": "garden_models.gravity.reference_camera",
    "view_decoder": "garden_models.gravity.view_decoder",
}
"""Whole names, so that a step's key sees which code it reaches."""

TRAINED = ("view_decoder",)
"""Methods that read a checkpoint."""


def _method(name: str) -> Method:
    def estimate(reconstruction: Reconstruction) -> GravityEvidence | None:
        found: GravityEvidence | None = import_module(MODULES[name]).estimate(reconstruction)
        return found

    return estimate


METHODS: dict[str, Callable[[Reconstruction], GravityEvidence | None]] = {
    name: _method(name) for name in MODULES
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
    module = import_module(MODULES[name])
    if name in TRAINED:
        trained: Cue | None = module.read(reconstruction, weights)
        return trained
    if hasattr(module, "read"):
        cue: Cue | None = module.read(reconstruction)
        return cue
    evidence = METHODS[name](reconstruction)
    return None if evidence is None else cue_of_evidence(evidence)
