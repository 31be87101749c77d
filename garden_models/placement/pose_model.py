"""What a model that estimates a known mesh's pose is asked and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8


@dataclass(frozen=True)
class PoseRequest:
    """One photo with metric depth, the object's mask, and its mesh in the object frame.

    Metres, OpenCV camera, pixel centres at +0.5, ``depth`` 0 where there is none.
    ``gv_from_camera`` (3x3) is the camera's turn to Gravity-View. With ``upright`` the
    hypotheses are turns about gravity only, and each iteration's result is projected back
    to one; without, all rotations are free (the paper's ablation).
    """

    SCHEMA: ClassVar[str] = "garden.PoseRequest/1"
    rgb: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"]
    K: Float[np.ndarray, "3 3"]
    mask: Bool[np.ndarray, "h w"]
    vertices: Float[np.ndarray, "v 3"]
    faces: Int[np.ndarray, "f 3"]
    vertex_rgb: UInt8[np.ndarray, "v 3"]
    gv_from_camera: Float[np.ndarray, "3 3"]
    upright: bool = True
    iterations: int = 5
    keep: int = 3


@dataclass(frozen=True)
class PoseAnswer:
    """The best poses, best first: rigid ``camera_from_object`` and the model's own scores."""

    SCHEMA: ClassVar[str] = "garden.PoseAnswer/1"
    camera_from_object: Float[np.ndarray, "k 4 4"]
    scores: Float[np.ndarray, " k"]


EstimatePose = Callable[[PoseRequest], PoseAnswer]
