"""The paper's own models: what each is called, what it needs, what it may be used for.

An adapter is a file of its stage's room with ``CARD`` and
``load(weights, device) -> Callable[[Request], Response]``; request and response are nouns of
that room. It converts to and from the model's own conventions, once, and imports the model
only in ``load``. Adding one is that file and a line here.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from garden_models.foundation.model_card import ModelCard

ADAPTERS: dict[str, str] = {
    "depth_anything_3": "garden_models.reconstruction.depth_anything_3",
    "vggt": "garden_models.reconstruction.vggt",
    "pi3": "garden_models.reconstruction.pi3",
    "geocalib": "garden_models.photo_gravity.geocalib",
    "grounding_dino": "garden_models.targets.grounding_dino",
    "sam3": "garden_models.segmentation.sam3_tracker",
    "sam2": "garden_models.segmentation.sam2",
    "sam3d_objects": "garden_models.meshing.sam3d_objects",
    "foundation_pose": "garden_models.placement.foundation_pose",
}
"""Whole module names by model name, so that a step's key sees which code it reaches."""


def card(name: str) -> ModelCard:
    """Return a model's card. Raises BadInput for a name that ``ADAPTERS`` does not hold."""
    from garden_models.scene import BadInput

    if name not in ADAPTERS:
        raise BadInput(f"no model is called {name!r}; there are {', '.join(ADAPTERS)}")
    found: ModelCard = import_module(ADAPTERS[name]).CARD
    return found
