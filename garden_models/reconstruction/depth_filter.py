"""Decide which depths are kept."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from garden_models.reconstruction.depth_consistency import Agreement
from garden_models.reconstruction.planes import Planes, shifted

MIN_SUPPORT = 4  # of 8 neighbours that must lie on the pixel's own plane
MIN_ISLAND_SHARE = 2e-4  # of the photo's pixels; smaller islands of depth are dropped


def filter_depth(
    agreed: Agreement,
    planes: Planes,
    step: Float[Tensor, "h w"],
    min_agreeing: int,
) -> Bool[Tensor, "h w"]:
    """Tell which pixels keep their depth: enough photos agree, not more look through the
    spot, neighbours carry on the surface, and it is no speck.

    ``step`` is the inverse depth of one pixel of parallax. Pixels halfway between an object
    and what is behind it fail the third test.
    """
    keep = (agreed.count >= min_agreeing) & (agreed.free <= agreed.count)
    keep &= surface_support(planes, keep, step) >= MIN_SUPPORT
    return without_specks(keep, agreed.mean_w, step)


def surface_support(
    planes: Planes, valid: Bool[Tensor, "h w"], step: Float[Tensor, "h w"]
) -> Float[Tensor, "h w"]:
    """Count the valid 8-neighbours that the pixel's plane meets within a pixel of parallax."""
    total = torch.zeros_like(planes.w)
    as_float = valid.float()
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            if dx == dy == 0:
                continue
            expected = planes.w + planes.gx * dx + planes.gy * dy
            near = (shifted(planes.w, dx, dy) - expected).abs() < step
            total += near * shifted(as_float, dx, dy)
    return total


def without_specks(
    keep: Bool[Tensor, "h w"], w: Float[Tensor, "h w"], step: Float[Tensor, "h w"]
) -> Bool[Tensor, "h w"]:
    """Drop islands of kept pixels, bounded also by depth jumps, that are too small to trust."""
    mask = keep.cpu().numpy()
    jump = torch.zeros_like(w)
    across = (w[:, 1:] - w[:, :-1]).abs() > 4 * step[:, 1:]
    down = (w[1:] - w[:-1]).abs() > 4 * step[1:]
    jump[:, 1:] += across
    jump[1:] += down
    whole = (mask & (jump.cpu().numpy() == 0)).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(whole, connectivity=8)
    smallest = MIN_ISLAND_SHARE * mask.size
    large = stats[:, cv2.CC_STAT_AREA] >= smallest
    large[0] = False
    assert count == len(large)
    kept = large[labels]
    # pixels on the jump line itself belong to whichever kept island they touch
    touched = cv2.dilate(kept.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return torch.from_numpy(kept | (mask & touched)).to(keep.device)
