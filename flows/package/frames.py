"""List every frame of a package with its 4x4 matrices both ways (``frames.json``)."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from garden_models.scene import GravityView, Scale

ZUP_FROM_GV = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""Gravity-View (y down) to z-up metres: MJCF, URDF, SDF, USD and the point clouds."""

GLTF_FROM_GV = np.diag([1.0, -1, -1, 1])
"""Gravity-View (y down) to glTF (y up)."""

DESCRIPTIONS = {
    "world": "frame of the given or estimated cameras: cameras/, gravity.direction_world",
    "gv": "Gravity-View: y is gravity (down), origin at the reference camera",
    "zup": "z up: scene.xml, assets/, background/",
    "gltf": "y up: scene.glb",
}


def frames_document(gravity_view: GravityView, scale: Scale) -> dict[str, Any]:
    """Return ``frames.json``: each frame against Gravity-View, metres under ``scale``."""
    to_gv: dict[str, Float[np.ndarray, "4 4"]] = {
        "world": gravity_view.gv_from_world,
        "gv": np.eye(4),
        "zup": np.linalg.inv(ZUP_FROM_GV),
        "gltf": np.linalg.inv(GLTF_FROM_GV),
    }
    frames = {
        name: {
            "description": DESCRIPTIONS[name],
            f"gv_from_{name}": matrix.tolist(),
            f"{name}_from_gv": np.linalg.inv(matrix).tolist(),
        }
        for name, matrix in to_gv.items()
    }
    return {
        "schema": "garden.frames/1",
        "unit": "metre",
        "scale": {
            "source": scale.source,
            "metres_per_unit": scale.metres_per_unit,
            "note": scale.note,
        },
        "camera_axes": "OpenCV: x right, y down, z forward",
        "frames": frames,
    }
