"""Smooth a cost volume along eight directions (semi-global matching, Hirschmueller 2008).

A step of one label costs ``small_step``, any larger jump ``large_step`` weakened where the
photo has an edge, so that jumps go to where object outlines can be.
"""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def semi_global(
    cost: Float[Tensor, "labels h w"],
    grey: Float[Tensor, "h w"],
    small_step: float,
    large_step: float,
    edge_scale: float,
) -> Float[Tensor, "labels h w"]:
    """Return the mean over 8 directions of the aggregated cost (same unit as ``cost``).

    ``edge_scale`` is the grey difference (0..1) at which a jump costs 1/e of ``large_step``
    (never less than ``small_step``).
    """
    down = _vertical(cost, grey, small_step, large_step, edge_scale)
    up = _vertical(cost.flip(1), grey.flip(0), small_step, large_step, edge_scale).flip(1)
    across, grey_t = cost.transpose(1, 2), grey.T
    right = _straight(across, grey_t, small_step, large_step, edge_scale)
    left = _straight(across.flip(1), grey_t.flip(0), small_step, large_step, edge_scale).flip(1)
    return (down + up + (right + left).transpose(1, 2)) / 8


def _jump_cost(
    difference: Float[Tensor, "*s"], small_step: float, large_step: float, edge_scale: float
) -> Float[Tensor, "*s"]:
    return (large_step * torch.exp(-difference.abs() / edge_scale)).clamp_(min=small_step)


def _advance(
    previous: Float[Tensor, "labels n"],
    cost: Float[Tensor, "labels n"],
    small_step: float,
    jump: Float[Tensor, " n"],
) -> Float[Tensor, "labels n"]:
    lowest = previous.min(dim=0).values
    best = torch.minimum(previous, lowest + jump)
    best[1:] = torch.minimum(best[1:], previous[:-1] + small_step)
    best[:-1] = torch.minimum(best[:-1], previous[1:] + small_step)
    return best.sub_(lowest).add_(cost)


def _straight(
    cost: Float[Tensor, "labels h w"],
    grey: Float[Tensor, "h w"],
    small_step: float,
    large_step: float,
    edge_scale: float,
) -> Float[Tensor, "labels h w"]:
    """Aggregate from the first row to the last."""
    rows = cost.transpose(0, 1).contiguous()
    jump = _jump_cost(grey[1:] - grey[:-1], small_step, large_step, edge_scale)
    state = rows[0]
    out = [state]
    for row in range(1, len(rows)):
        state = _advance(state, rows[row], small_step, jump[row - 1])
        out.append(state)
    return torch.stack(out, dim=1)


def _vertical(
    cost: Float[Tensor, "labels h w"],
    grey: Float[Tensor, "h w"],
    small_step: float,
    large_step: float,
    edge_scale: float,
) -> Float[Tensor, "labels h w"]:
    """Aggregate from the first row to the last along the column and both diagonals; sum."""
    labels, _, width = cost.shape
    rows = cost.transpose(0, 1).contiguous()
    state = rows[0].repeat(1, 3)
    total = [3 * rows[0]]
    for row in range(1, len(rows)):
        straight, from_left, from_right = state.split(width, dim=1)
        before = grey[row - 1]
        arriving = torch.cat(
            [
                straight,
                from_left[:, :1],
                from_left[:, :-1],
                from_right[:, 1:],
                from_right[:, -1:],
            ],
            dim=1,
        )
        source = torch.cat([before, before[:1], before[:-1], before[1:], before[-1:]])
        jump = _jump_cost(grey[row].repeat(3) - source, small_step, large_step, edge_scale)
        state = _advance(arriving, rows[row].repeat(1, 3), small_step, jump)
        total.append(state.view(labels, 3, width).sum(dim=1))
    return torch.stack(total, dim=1)
