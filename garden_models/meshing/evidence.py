"""Gather, for each voxel, what depth maps and silhouettes of all views say about it.

Depth gives a truncated signed distance (Curless and Levoy 1996), silhouettes a signed
distance to the visual hull (Laurentini 1994). A voxel outside a picture, or behind
something nearer than itself, is unknown to that view. The hull distance is not the largest
over the views but a high order statistic, so that a few wrong masks cannot carve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float

from garden_models.meshing.object_view import ObjectView

CHUNK = 1 << 16
"""Points handled at a time, so that all that is known of them stays in the cache."""

MOST_OUTVOTED = 4
"""Largest number of views that can be outvoted, which bounds the memory per voxel."""


@dataclass(frozen=True)
class Evidence:
    """Evidence at points in metres; distances are positive outside the object.

    ``surface`` is the weighted mean of truncated signed distances, meaningful where
    ``surface_weight`` (sum over views) is above 0. ``hull`` is the signed distance to the
    visual hull (a lower bound outside). ``voters`` counts the views that know the point.
    ``hidden`` marks points that lie behind other things in some view, ``foreign`` those that
    lie closer behind these than behind the object's own surface: unseen, they rather belong
    to those.
    """

    surface: Float[np.ndarray, " n"]
    surface_weight: Float[np.ndarray, " n"]
    hull: Float[np.ndarray, " n"]
    voters: Float[np.ndarray, " n"]
    hidden: Bool[np.ndarray, " n"]
    foreign: Bool[np.ndarray, " n"]


def gather_evidence(
    points_gv: Float[np.ndarray, "n 3"],
    views: Sequence[ObjectView],
    truncation: float,
    outvoted_share: float,
    *,
    use_depth: bool = True,
) -> Evidence:
    """Return the evidence of all ``views`` at ``points_gv`` (GV metres).

    ``truncation`` in metres; ``outvoted_share`` (0..1) of the views that know a point may
    call it empty without effect.
    """
    points = torch.from_numpy(np.ascontiguousarray(points_gv, np.float32))
    prepared = [_Prepared.of(view) for view in views]
    kept = min(MOST_OUTVOTED, int(len(views) * outvoted_share)) + 1
    parts = [
        _gather(part, prepared, truncation, outvoted_share, kept, use_depth)
        for part in torch.split(points, CHUNK)
    ]
    surface, weight, hull, voters, behind_own, behind_other = (
        torch.cat(column).numpy() for column in zip(*parts, strict=True)
    )
    hidden = np.isfinite(behind_other)
    return Evidence(surface, weight, hull, voters, hidden, behind_other < behind_own)


@dataclass(frozen=True)
class _Prepared:
    """A view as tensors: ``pixels_from_gv`` is ``K @ camera_from_gv``; ``maps`` holds, per
    pixel, outline distance, depth of the own or a foreign surface (0: never trusted), own
    depth, cosine and trust.
    """

    pixels_from_gv: torch.Tensor
    maps: torch.Tensor
    size: tuple[int, int]
    focal_px: float

    @classmethod
    def of(cls, view: ObjectView) -> _Prepared:
        nearest = np.where(view.mask, view.filled_depth, view.occluder_depth)
        nearest = np.where(view.unknown, 0.0, nearest)
        layers = (view.outside_px, nearest, view.depth, view.cosine, view.weight)
        maps = np.stack(layers, axis=-1).reshape(-1, len(layers)).astype(np.float32)
        matrix = (view.K @ view.camera_from_gv[:3]).astype(np.float32)
        height, width = view.mask.shape
        return cls(torch.from_numpy(matrix), torch.from_numpy(maps), (width, height), view.focal_px)


def _gather(
    points: torch.Tensor,
    views: Sequence[_Prepared],
    truncation: float,
    outvoted_share: float,
    kept: int,
    use_depth: bool,
) -> tuple[torch.Tensor, ...]:
    """Return surface, weight, hull, voters, and how far points lie behind own and other things."""
    count = len(points)
    surface, weight, voters = torch.zeros(count), torch.zeros(count), torch.zeros(count)
    largest = torch.full((kept, count), -torch.inf)
    behind_own = torch.full((count,), torch.inf)
    behind_other = torch.full((count,), torch.inf)
    for view in views:
        pixel, z, inside = _project(points, view)
        outside_px, nearest, depth, cosine, trust = view.maps[pixel].unbind(1)
        behind = z - nearest
        in_mask = outside_px < 0
        hidden = ~in_mask & (behind > truncation)
        own = torch.where(inside & in_mask, behind.abs(), torch.inf)
        other = torch.where(inside & hidden, behind, torch.inf)
        behind_own = torch.minimum(behind_own, own)
        behind_other = torch.minimum(behind_other, other)
        known = inside & ~hidden
        voters += known
        _insert(largest, torch.where(known, outside_px * (z / view.focal_px), -torch.inf))
        if use_depth:
            # Along a slanted ray the surface is nearer than the difference in depth.
            distance = (depth - z) * torch.clamp(cosine, min=0.3)
            seen = inside & (depth > 0) & (distance > -truncation)
            trust = torch.where(seen, trust, 0.0)
            surface += trust * torch.clamp(distance, max=truncation)
            weight += trust
    rank = torch.clamp((voters * outvoted_share).long(), max=kept - 1)
    hull = torch.nan_to_num(torch.gather(largest, 0, rank[None])[0], neginf=-truncation)
    surface /= torch.clamp(weight, min=1e-9)
    return surface, weight, hull, voters, behind_own, behind_other


def _project(
    points: torch.Tensor, view: _Prepared
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return flat pixel index, depth along z and whether the point is in the picture."""
    matrix = view.pixels_from_gv
    u, v, z = torch.addmm(matrix[:, 3], points, matrix[:, :3].T).unbind(1)
    width, height = view.size
    safe = torch.clamp(z, min=1e-6)
    column = torch.floor(u / safe)
    row = torch.floor(v / safe)
    inside = (z > 1e-6) & (column >= 0) & (row >= 0) & (column < width) & (row < height)
    pixel = torch.where(inside, row * width + column, 0.0).long()
    return pixel, z, inside


def _insert(largest: torch.Tensor, value: torch.Tensor) -> None:
    """Keep the largest values seen so far in ``largest``, in descending order."""
    for rank in range(len(largest)):
        higher = torch.maximum(largest[rank], value)
        value = torch.minimum(largest[rank], value)
        largest[rank] = higher
