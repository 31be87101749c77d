"""Collect the methods of the gravity table, ours and all others, and run them on scenes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from garden_models.gravity import METHODS, geocalib, read_cue, view_decoder
from garden_models.gravity.align import align_gravity
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.decoder.checkpoint import Checkpoint, from_bytes
from garden_models.gravity.decoder.token_layout import KIND, TOKEN_WIDTH
from garden_models.gravity.fuse import fuse_cues
from garden_models.gravity.protocol import Cue
from garden_models.photo_gravity.photo_gravity import ReadPhotoGravity
from garden_models.scene import BadGeometry, GravityEvidence, Reconstruction

Method = Callable[[Reconstruction], GravityEvidence | None]

OURS, CLASSICAL, DECODER = "ours, fused", "classical cues fused", "decoder alone"
BASELINES: dict[str, str] = {
    "Plane-RANSAC": "plane_ransac",
    "normal clustering": "normal_clustering",
    "COLMAP's Manhattan": "manhattan_frame",
    "mean camera up": "mean_camera_up",
    "camera x axes": "camera_x_axes",
}
CLASSICAL_CUES = ("planes", "vanishing_points", "camera_x_axes")
GEOCALIB, GEOCALIB_RANSAC = "GeoCalib", "GeoCalib+RANSAC"


@dataclass(frozen=True)
class DecoderWeights:
    """A gravity decoder's checkpoint, as safetensors (empty: none)."""

    SCHEMA: ClassVar[str] = "garden.GravityDecoderWeights/1"
    data: bytes = b""


@dataclass(frozen=True)
class GravityEstimates:
    """What methods say of one reconstruction: directions down in its world (NaN: no answer)
    and their sigmas in degrees.
    """

    SCHEMA: ClassVar[str] = "garden.GravityEstimates/1"
    methods: tuple[str, ...]
    down_world: Float[np.ndarray, "m 3"]
    sigma_deg: Float[np.ndarray, " m"]


@dataclass(frozen=True)
class GravityErrors:
    """Angular errors and sigmas (degrees, NaN: none) of methods on the scenes of a condition."""

    SCHEMA: ClassVar[str] = "garden.GravityErrors/1"
    methods: tuple[str, ...]
    scenes: tuple[str, ...]
    errors_deg: Float[np.ndarray, "m s"]
    sigmas_deg: Float[np.ndarray, "m s"]


def table_methods(
    weights: DecoderWeights, ask_geocalib: ReadPhotoGravity | None = None
) -> dict[str, Method]:
    """Return the methods that can run, by their names in the table."""
    methods: dict[str, Method] = {CLASSICAL: _fused_classical}
    if weights.data:
        known = from_bytes(weights.data, KIND, TOKEN_WIDTH)
        methods = {
            OURS: partial(_fused_with, known),
            DECODER: lambda r: _alone(view_decoder.read_with(known, r)),
            **methods,
        }
    methods |= {name: METHODS[method] for name, method in BASELINES.items()}
    if ask_geocalib is not None:
        for name, consensus in ((GEOCALIB, False), (GEOCALIB_RANSAC, True)):
            methods[name] = partial(geocalib.estimate, predict=ask_geocalib, consensus=consensus)
    return methods


def run_methods(methods: Mapping[str, Method], reconstruction: Reconstruction) -> GravityEstimates:
    """Run every method on a reconstruction; one that cannot tell gives no answer."""
    downs, sigmas = np.full((len(methods), 3), np.nan), np.full(len(methods), np.nan)
    for k, method in enumerate(methods.values()):
        try:
            found = method(reconstruction)
        except BadGeometry:
            found = None
        if found is not None:
            downs[k], sigmas[k] = found.down_world, found.sigma_deg
    return GravityEstimates(tuple(methods), downs, sigmas)


def _fused_classical(reconstruction: Reconstruction) -> GravityEvidence:
    found = align_gravity(reconstruction, AlignGravity())
    return GravityEvidence(CLASSICAL, found.down_world, found.sigma_deg, True)


def _fused_with(known: Checkpoint, reconstruction: Reconstruction) -> GravityEvidence:
    cues = [read_cue(name, reconstruction) for name in CLASSICAL_CUES]
    cues.append(view_decoder.read_with(known, reconstruction))
    fused = fuse_cues(tuple(cue for cue in cues if cue is not None))
    return GravityEvidence(OURS, fused.down_world, fused.sigma_deg, True)


def _alone(cue: Cue | None) -> GravityEvidence | None:
    return None if cue is None else cue.alone()
