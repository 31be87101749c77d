"""Turn evidence into one token a view, written in a start frame whose y is taken for down.

A token holds, of the view and of the whole scene: how normals and lines spread over the
sphere; how exactly they meet the frame's axes, as tilts to the nearest agreement; at which
heights along each axis the surfaces lie and which way they face; and where the camera is and
looks. All numbers are of the order of one and free of the unit of length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from garden_models.geometry.direction import hemisphere
from garden_models.gravity.decoder.evidence import ViewEvidence
from garden_models.gravity.decoder.token_layout import (
    DAMPING,
    FACING,
    FACING_HEIGHTS,
    HALF_SPHERE,
    HEIGHTS,
    LINE_GATES,
    LINE_KERNEL,
    NORMAL_GATES,
    NORMAL_KERNEL,
    REACH,
    SPHERE,
    TILT_UNIT,
)

_SIGNED_AXES = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class EvidenceBatch:
    """Evidence of scenes with equally many views as tensors (batch, views, ...), see
    ``ViewEvidence``; ``scale`` (batch,) is the median distance of surfaces from their cameras.
    """

    rotation: Tensor
    centre: Tensor
    place: Tensor
    normal: Tensor
    normal_weight: Tensor
    line: Tensor
    line_sigma: Tensor
    line_weight: Tensor
    scale: Tensor

    def to(self, device: str | torch.device) -> EvidenceBatch:
        """Return the batch on a device."""
        return EvidenceBatch(*(getattr(self, name).to(device) for name in self.__annotations__))


def evidence_batch(scenes: list[ViewEvidence]) -> EvidenceBatch:
    """Return scenes with equally many views as one batch (float32)."""
    names = [n for n in EvidenceBatch.__annotations__ if n != "scale"]
    arrays = {n: np.stack([getattr(scene, n) for scene in scenes]) for n in names}
    arrays["scale"] = np.array([_scale(scene) for scene in scenes])
    return EvidenceBatch(
        **{n: torch.from_numpy(np.ascontiguousarray(a, np.float32)) for n, a in arrays.items()}
    )


def _scale(scene: ViewEvidence) -> float:
    distance = np.linalg.norm(scene.place - scene.centre[:, None], axis=-1)
    known = distance[scene.normal_weight > 0]
    if len(known):
        return max(float(np.median(known)), 1e-9)
    spread = np.linalg.norm(scene.centre - scene.centre.mean(axis=0), axis=1).max()
    return max(float(spread), 1e-9)


def view_tokens(evidence: EvidenceBatch, start_from_world: Tensor) -> Tensor:
    """Return tokens (batch, views, ``TOKEN_WIDTH``) in start frames (batch, 3, 3)."""
    turn = start_from_world[:, None].mT
    normal = evidence.normal @ turn
    line = evidence.line @ turn
    place = (evidence.place - evidence.centre[:, :, None]) @ turn / evidence.scale.view(-1, 1, 1, 1)
    sums = [
        _spread_of_normals(normal, evidence.normal_weight),
        _spread_of_lines(line, evidence.line_sigma, evidence.line_weight),
        _normal_sums(normal, evidence.normal_weight),
        _line_sums(line, evidence.line_sigma, evidence.line_weight),
        _height_sums(place, evidence.normal_weight),
        _facing_sums(place, normal, evidence.normal_weight),
    ]
    amounts = torch.stack(
        [evidence.normal_weight.sum(dim=-1), evidence.line_weight.sum(dim=-1)], dim=-1
    )
    own = _features(sums, amounts)
    whole = _features([s.sum(dim=1, keepdim=True) for s in sums], amounts.sum(dim=1, keepdim=True))
    middle = evidence.centre.mean(dim=1, keepdim=True)
    centre = (evidence.centre - middle) @ start_from_world.mT / evidence.scale.view(-1, 1, 1)
    camera = torch.cat([(evidence.rotation @ turn).flatten(2), centre.clamp(-4, 4)], dim=-1)
    cameras = camera.mean(dim=1, keepdim=True)
    views = own.shape[1]
    return torch.cat(
        [own, whole.expand(-1, views, -1), camera, cameras.expand(-1, views, -1)], dim=-1
    )


def _features(sums: list[Tensor], amounts: Tensor) -> Tensor:
    """Return the parts of a token from sums over normals and lines."""
    normals, lines = (amounts[..., k : k + 1].clamp(min=1e-6) for k in (0, 1))
    spread, line_spread, normal_tilts, line_tilts, heights, facing = sums
    parts = [
        (spread / normals * SPHERE).clamp(min=0).sqrt() * 0.5,
        (line_spread / lines * 4).clamp(min=0).sqrt() * 0.5,
        _normal_tilts(normal_tilts, normals),
        _line_tilts(line_tilts, lines),
        (heights / normals[..., None] * HEIGHTS).clamp(min=0).sqrt() * 0.5,
        (facing / normals[..., None] * FACING_HEIGHTS).clamp(min=0).sqrt() * 0.5,
        torch.log1p(amounts) / 4,
    ]
    return torch.cat([part.flatten(2) for part in parts], dim=-1)


def _spread_of_normals(normal: Tensor, weight: Tensor) -> Tensor:
    half = hemisphere(SPHERE // 2)
    grid = _like(np.concatenate([half, -half]), normal)
    kernel = torch.exp((normal @ grid.T - 1) / NORMAL_KERNEL**2)
    share = kernel / kernel.sum(dim=-1, keepdim=True).clamp(min=1e-9)
    return (weight[..., None] * share).sum(dim=2)


def _spread_of_lines(line: Tensor, sigma: Tensor, weight: Tensor) -> Tensor:
    grid = _like(hemisphere(HALF_SPHERE), line)
    wide = torch.hypot(sigma, torch.full_like(sigma, LINE_KERNEL))[..., None]
    return (weight[..., None] * torch.exp(-0.5 * (line @ grid.T / wide).square())).sum(dim=2)


def _normal_sums(normal: Tensor, weight: Tensor) -> Tensor:
    """Return mass and tilts (b, v, 6, gates, 3) of the normals near each signed axis."""
    along = normal @ _like(_SIGNED_AXES, normal).T
    parts = []
    for gate in NORMAL_GATES:
        near = weight[..., None] * torch.exp((along - 1) / gate**2)
        tilts = torch.einsum("bvpa,bvpc->bvac", near, normal)
        # Of the mean normal near an axis the two other components are its tilt.
        parts.append(torch.cat([near.sum(dim=2)[..., None], _across(tilts)], dim=-1))
    return torch.stack(parts, dim=3)


def _across(vectors: Tensor) -> Tensor:
    """Return, of one vector for each signed axis (..., 6, 3), the components across it."""
    rows = [vectors[..., k, [(k + 1) % 3, (k + 2) % 3]] for k in range(3)]
    rows += [vectors[..., k + 3, [(k + 1) % 3, (k + 2) % 3]] for k in range(3)]
    return torch.stack(rows, dim=-2)


def _normal_tilts(sums: Tensor, total: Tensor) -> Tensor:
    mass = sums[..., :1]
    tilt = sums[..., 1:] / (mass + 0.002 * total[..., None, None]) / TILT_UNIT
    share = (mass / total[..., None, None] * 4).sqrt()
    return torch.cat([share, tilt.clamp(-4, 4)], dim=-1)


def _line_sums(line: Tensor, sigma: Tensor, weight: Tensor) -> Tensor:
    """Return mass, normal matrix and right side (b, v, 3, gates, 6) of the lines along axes."""
    parts = []
    for gate in LINE_GATES:
        wide = torch.hypot(sigma, torch.full_like(sigma, gate))
        for axis in range(3):
            s, t = line[..., (axis + 1) % 3], line[..., (axis + 2) % 3]
            off = line[..., axis]
            near = weight * torch.exp(-0.5 * (off / wide).square())
            terms = [near, near * s * s, near * s * t, near * t * t, -near * s * off]
            parts.append(torch.stack([x.sum(dim=2) for x in [*terms, -near * t * off]], dim=-1))
    stacked = torch.stack(parts, dim=2)
    return stacked.unflatten(2, (len(LINE_GATES), 3)).transpose(2, 3)


def _line_tilts(sums: Tensor, total: Tensor) -> Tensor:
    """Return, for each axis and gate, the share of lines along it and the axis's tilt."""
    mass, ss, st, tt, right_s, right_t = sums.unbind(dim=-1)
    ridge = DAMPING * total[..., None]
    ss, tt = ss + ridge, tt + ridge
    determinant = ss * tt - st * st
    tilt = torch.stack([tt * right_s - st * right_t, ss * right_t - st * right_s], dim=-1)
    tilt = tilt / determinant.clamp(min=1e-12)[..., None] / TILT_UNIT
    share = (mass / total[..., None] * 2).sqrt()[..., None]
    return torch.cat([share, tilt.clamp(-4, 4)], dim=-1)


def _height_sums(place: Tensor, weight: Tensor) -> Tensor:
    return (weight[..., None, None] * _bins(place, HEIGHTS)).sum(dim=2)


def _facing_sums(place: Tensor, normal: Tensor, weight: Tensor) -> Tensor:
    along = normal @ _like(_SIGNED_AXES, normal).T
    faces = weight[..., None] * (along > FACING)
    bins = _bins(place, FACING_HEIGHTS)
    return torch.einsum("bvpa,bvpah->bvah", faces, torch.cat([bins, bins], dim=3))


def _bins(values: Tensor, count: int) -> Tensor:
    """Return the shares (..., count) of each value in the two bins that it lies between."""
    at = ((values / REACH).clamp(-1, 1) + 1) / 2 * (count - 1)
    places = torch.arange(count, device=values.device, dtype=values.dtype)
    return (1 - (at[..., None] - places).abs()).clamp(min=0)


def _like(array: np.ndarray, other: Tensor) -> Tensor:
    return torch.from_numpy(np.asarray(array, np.float32)).to(other.device, other.dtype)
