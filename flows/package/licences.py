"""Say what made a package and under which licence (``LICENSES.json``)."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version
from typing import Any

from garden_models.foundation import ADAPTERS, card

COMPONENTS = {
    "garden-scenes": ("Apache-2.0", "every step"),
    "pycolmap": ("BSD-3-Clause", "register"),
    "torch": ("BSD-3-Clause", "reconstruct"),
    "opencv-python-headless": ("Apache-2.0", "ingest, segment"),
    "scikit-image": ("BSD-3-Clause", "mesh_object"),
    "scipy": ("BSD-3-Clause", "several steps"),
    "numpy": ("BSD-3-Clause", "every step"),
    "trimesh": ("MIT", "mesh_object, export"),
    "fast-simplification": ("MIT", "mesh_object"),
    "coacd": ("MIT", "compose"),
    "mujoco": ("Apache-2.0", "simulate"),
}


def licences_document(backends: Iterable[str] = (), services: Iterable[str] = ()) -> dict[str, Any]:
    """Return the components of a package with version, licence and use.

    ``backends`` are those of its steps, ``model`` or ``model/variant``; what is no model with
    a card of its own is GARDEN's code. Commercial use is allowed if every model allows it.
    ``services`` are models that were asked over a network.
    """
    models = [_model(*found) for found in sorted({_named(b) for b in backends}) if found[0]]
    return {
        "schema": "garden.licences/1",
        "commercial_use": all(model["commercial_use"] for model in models),
        "components": [
            {"name": name, "version": version(name), "licence": licence, "used_by": used_by}
            for name, (licence, used_by) in COMPONENTS.items()
        ],
        "models": models,
        "services": [
            {"name": name, "used_by": "targets", "note": "asked over HTTP under its server's terms"}
            for name in services
        ],
        "note": "The photos' own rights stay with whoever holds them.",
    }


def _named(backend: str) -> tuple[str, str]:
    """Return the model and its variant, empty texts for GARDEN's own code."""
    name, _, variant = backend.partition("/")
    return (name, variant) if name in ADAPTERS else ("", "")


def _model(name: str, variant: str) -> dict[str, Any]:
    about = card(name)
    terms = about.terms_of(variant)
    return {
        "name": f"{name}/{variant}" if variant else name,
        "title": about.title,
        "source": about.source,
        "code_licence": terms.code,
        "weights_licence": terms.weights,
        "commercial_use": terms.commercial,
        "used_by": about.stage,
    }
