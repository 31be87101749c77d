"""Draw what a step sees: scenes, some of their views, and start frames that are wrong somehow."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from garden_models.geometry.gravity_view import gv_from_camera
from garden_models.geometry.rotation import axis_angle, normalized
from garden_models.gravity.decoder.evidence import ViewEvidence
from garden_models.gravity.decoder.start_frame import frame_of
from garden_models.gravity.decoder.summits import summits
from garden_models.gravity.decoder.tokens import EvidenceBatch, evidence_batch
from garden_models.gravity.training.config import GravityOptimisation
from garden_models.gravity.training.shard import EvidenceShard

Direction = Float[np.ndarray, "3"]

NEAR, ROUGH = np.radians(2.5), np.radians(15.0)
WITHOUT_LINES, WITHOUT_SURFACES = 0.08, 0.08
"""Shares of scenes that are learned from without one of the two."""


@dataclass(frozen=True)
class Batch:
    """What a step sees: ``true`` is the rotation from each start frame to Gravity-View."""

    evidence: EvidenceBatch
    start: Tensor
    reference: Tensor
    true: Tensor


def batch_at(step: int, data: EvidenceShard, config: GravityOptimisation) -> Batch:
    """Return the batch of a step; it follows from the step's number and the seed."""
    rng = np.random.default_rng((config.seed, 1, step))
    most = int(data.views.max())
    views = int(rng.integers(min(2, most), most + 1))
    large_enough = np.flatnonzero(data.views >= views)
    count = max(1, config.tokens_a_batch // views)
    scenes, starts, trues = [], [], []
    for k in rng.choice(large_enough, count):
        scene, down = some_views(data.scene(int(k)), views, rng), data.down[k]
        reference = scene.rotation[scene.reference]
        start = frame_of(wrong_down(down, scene, rng), reference)
        scenes.append(scene)
        starts.append(start)
        trues.append(gv_from_camera(reference @ down) @ reference @ start.T)
    return Batch(
        evidence_batch(scenes).to(config.device),
        _tensor(starts, config.device),
        torch.tensor([scene.reference for scene in scenes], device=config.device),
        _tensor(trues, config.device),
    )


def some_views(scene: ViewEvidence, count: int, rng: np.random.Generator) -> ViewEvidence:
    """Return some of the views in their order, another reference; now and then without lines
    or without surfaces.
    """
    kept = np.sort(rng.permutation(len(scene))[:count])
    fields = [f.name for f in dataclasses.fields(scene) if f.name != "reference"]
    parts = {name: getattr(scene, name)[kept] for name in fields}
    chance = rng.uniform()
    if chance < WITHOUT_LINES:
        parts["line_weight"] = np.zeros_like(parts["line_weight"])
    elif chance > 1 - WITHOUT_SURFACES:
        parts["normal_weight"] = np.zeros_like(parts["normal_weight"])
    return ViewEvidence(reference=int(rng.integers(count)), **parts)


def wrong_down(down: Direction, scene: ViewEvidence, rng: np.random.Generator) -> Direction:
    """Return a start: near the truth as the last round's, rough as the first's, or anything."""
    chance = rng.uniform()
    if chance < 0.4:
        return _tilted(down, NEAR * rng.normal(), rng)
    if chance < 0.55:
        return _tilted(down, ROUGH * rng.normal(), rng)
    if chance < 0.9:
        # What surfaces, lines and cameras offer instead: a level direction, or up.
        offered = summits(scene) if rng.uniform() < 0.7 else np.zeros((0, 3))
        if not len(offered):
            offered = scene.rotation[int(rng.integers(len(scene)))]
        other = offered[int(rng.integers(len(offered)))] * rng.choice([-1.0, 1.0])
        return _tilted(other, NEAR * rng.normal(), rng)
    return normalized(rng.normal(size=3))


def _tilted(direction: Direction, angle: float, rng: np.random.Generator) -> Direction:
    across = np.cross(direction, rng.normal(size=3))
    return np.asarray(axis_angle(across, angle) @ direction)


def _tensor(rotations: list[np.ndarray], device: str) -> Tensor:
    return torch.from_numpy(np.stack(rotations).astype(np.float32)).to(device)
