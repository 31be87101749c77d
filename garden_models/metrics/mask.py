"""Compare masks: intersection over union, and the boundary F score (Csurka et al. 2013)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

Mask = Bool[np.ndarray, "h w"]


def intersection_over_union(mask: Mask, truth: Mask) -> float:
    """Return |mask and truth| / |mask or truth|; two empty masks agree fully (1)."""
    _check_shapes(mask, truth)
    union = np.count_nonzero(mask | truth)
    return float(np.count_nonzero(mask & truth) / union) if union else 1.0


def mean_intersection_over_union(masks: tuple[Mask, ...], truths: tuple[Mask, ...]) -> float:
    """Return the mean IoU over the views in which the truth shows the object.

    Raises ValueError for different lengths, or if no truth shows it.
    """
    if len(masks) != len(truths):
        raise ValueError(f"expected as many masks as truths, got {len(masks)} and {len(truths)}")
    scores = [
        intersection_over_union(mask, truth)
        for mask, truth in zip(masks, truths, strict=True)
        if truth.any()
    ]
    if not scores:
        raise ValueError("no truth mask shows the object: there is nothing to compare with")
    return float(np.mean(scores))


def boundary_f(mask: Mask, truth: Mask, tolerance_px: float = 2.0) -> float:
    """Return the harmonic mean of boundary precision and recall within ``tolerance_px``.

    A boundary pixel is one of the mask with a 4-neighbour outside of it; the image border
    counts as outside of the object only where the object ends, so it is no boundary.
    Two masks without boundary agree fully (1); one without boundary scores 0.
    """
    _check_shapes(mask, truth)
    edge, truth_edge = boundary(mask), boundary(truth)
    if not edge.any() or not truth_edge.any():
        return float(edge.any() == truth_edge.any())
    precision = float(np.mean(_distance_to(truth_edge)[edge] <= tolerance_px))
    recall = float(np.mean(_distance_to(edge)[truth_edge] <= tolerance_px))
    total = precision + recall
    return 2.0 * precision * recall / total if total else 0.0


def boundary(mask: Mask) -> Mask:
    """Return the mask's pixels that touch a pixel outside of it (4-neighbours)."""
    return mask & ~ndimage.binary_erosion(mask, border_value=1)


def _distance_to(pixels: Mask) -> Float[np.ndarray, "h w"]:
    """Return each pixel's distance to the nearest of ``pixels``."""
    distance: Float[np.ndarray, "h w"] = ndimage.distance_transform_edt(~pixels)
    return distance


def _check_shapes(mask: Mask, truth: Mask) -> None:
    if mask.shape != truth.shape:
        raise ValueError(f"expected masks of one size, got {mask.shape} and {truth.shape}")
