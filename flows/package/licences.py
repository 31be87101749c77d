"""Say what made a package and under which licence (``LICENSES.json``)."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

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


def licences_document() -> dict[str, Any]:
    """Return the components of the embedded backends with version, licence and use."""
    return {
        "schema": "garden.licences/1",
        "commercial_use": True,
        "components": [
            {"name": name, "version": version(name), "licence": licence, "used_by": used_by}
            for name, (licence, used_by) in COMPONENTS.items()
        ],
        "note": "The photos' own rights stay with whoever holds them.",
    }
