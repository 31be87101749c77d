"""What a model that completes an object from one masked photo is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8


@dataclass(frozen=True)
class MeshRequest:
    """One photo, the object's mask, and each pixel's point in the OpenCV camera.

    ``points_camera`` is in the scene's unit, NaN where there is no depth.
    """

    SCHEMA: ClassVar[str] = "garden.MeshRequest/1"
    rgb: UInt8[np.ndarray, "h w 3"]
    mask: Bool[np.ndarray, "h w"]
    points_camera: Float[np.ndarray, "h w 3"]
    seed: int = 0


@dataclass(frozen=True)
class MeshAnswer:
    """A mesh in the model's upright frame turned to ours: y down, any origin, any unit.

    ``camera_from_mesh`` is the similarity (4x4) to the OpenCV camera of the request, in the
    unit of its points. ``texture`` with ``uv`` (origin at the lower left) is None if the
    mesh has colours at its vertices only.
    """

    SCHEMA: ClassVar[str] = "garden.MeshAnswer/1"
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    vertex_rgb: UInt8[np.ndarray, "v 3"]
    camera_from_mesh: Float[np.ndarray, "4 4"]
    uv: Float[np.ndarray, "v 2"] | None = None
    texture: UInt8[np.ndarray, "th tw 3"] | None = None


CompleteMesh = Callable[[MeshRequest], MeshAnswer]
