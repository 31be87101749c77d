"""What a model that predicts cameras and depth is asked and answers, in our conventions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from garden_models.scene import OK, Verdict


@dataclass(frozen=True)
class GeometryRequest:
    """Photos, upright, of any sizes; cameras of all of them or of none.

    ``K`` is in pixels of each photo (centres at +0.5), ``camera_from_world`` OpenCV.
    """

    SCHEMA: ClassVar[str] = "garden.GeometryRequest/1"
    photos: tuple[UInt8[np.ndarray, "h w 3"], ...]
    K: Float[np.ndarray, "n 3 3"] | None = None
    camera_from_world: Float[np.ndarray, "n 3 4"] | None = None
    want_gaussians: bool = False
    want_tokens: bool = False


@dataclass(frozen=True)
class Gaussians:
    """3D Gaussians in the world of the cameras that they come with.

    ``view`` is the index of the photo in which a Gaussian was found.
    ``scale`` is the standard deviation along each axis, ``rotation`` a unit quaternion wxyz
    (world from Gaussian), ``opacity`` in 0..1, ``rgb`` the view-independent colour in 0..1.
    """

    SCHEMA: ClassVar[str] = "garden.Gaussians/1"
    mean: Float[np.ndarray, "g 3"]
    scale: Float[np.ndarray, "g 3"]
    rotation: Float[np.ndarray, "g 4"]
    opacity: Float[np.ndarray, " g"]
    rgb: Float[np.ndarray, "g 3"]
    view: Int[np.ndarray, " g"]

    def subset(self, keep: Bool[np.ndarray, " g"]) -> Gaussians:
        """Return the Gaussians that ``keep`` selects."""
        return Gaussians(
            self.mean[keep],
            self.scale[keep],
            self.rotation[keep],
            self.opacity[keep],
            self.rgb[keep],
            self.view[keep],
        )


@dataclass(frozen=True)
class GeometryView:
    """One photo's prediction at the size that the model saw.

    ``K`` is for that size; ``depth`` is z-depth, 0 where there is none; ``confidence`` is in
    0..1. ``seen`` is False where the model saw nothing of the photo (it cuts photos to a
    common shape); ``depth`` there is 0.
    """

    depth: Float[np.ndarray, "h w"]
    confidence: Float[np.ndarray, "h w"]
    seen: Bool[np.ndarray, "h w"]
    K: Float[np.ndarray, "3 3"]
    camera_from_world: Float[np.ndarray, "3 4"]


@dataclass(frozen=True)
class CameraTokens:
    """What the model's camera decoder read of some views that it saw together.

    ``kind`` names the network (``da3-giant``), ``views`` are indices into the prediction's
    views, ``reference`` is the one of them that the model took as its reference.
    """

    kind: str
    views: Int[np.ndarray, " n"]
    tokens: Float[np.ndarray, "n c"]
    reference: int


@dataclass(frozen=True)
class GeometryPrediction:
    """Views in the order of the request, in one world: that of the given cameras if there
    were some. ``metric`` tells whether the model knows metres by itself. ``verdict`` holds
    remarks on how the prediction was made.
    """

    SCHEMA: ClassVar[str] = "garden.GeometryPrediction/1"
    views: tuple[GeometryView, ...]
    metric: bool
    camera_tokens: tuple[CameraTokens, ...] = ()
    gaussians: Gaussians | None = None
    verdict: Verdict = OK

    def fits(self, request: GeometryRequest) -> str:
        """Return what of the answer does not go with the request; nothing if all does."""
        if len(self.views) != len(request.photos):
            return f"{len(self.views)} views for {len(request.photos)} photos"
        if request.want_gaussians and self.gaussians is None:
            return "no Gaussians, which were asked for"
        if request.want_tokens and not self.camera_tokens:
            return "no camera tokens, which were asked for"
        return ""


def joined_gaussians(parts: Sequence[Gaussians]) -> Gaussians:
    """Return the Gaussians of all parts (at least one)."""
    names = [f.name for f in fields(Gaussians)]
    return Gaussians(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))


PredictGeometry = Callable[[GeometryRequest], GeometryPrediction]
