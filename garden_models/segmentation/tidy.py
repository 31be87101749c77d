"""Clean a mask of specks and pinholes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from scipy import ndimage

Mask = Bool[np.ndarray, "h w"]

SPECK = 0.01
"""Parts of less than this share of the largest are dropped unless points confirm them."""
PINHOLE = 0.002
"""Holes of less than this share of the mask are filled."""


def tidy_mask(mask: Mask, evident: Mask) -> Mask:
    """Drop small parts in which no pixel is ``evident``ly the object, and fill pinholes."""
    labels, count = ndimage.label(mask, np.ones((3, 3)))
    if count == 0:
        return mask.copy()
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    known = np.bincount(labels[evident & mask], minlength=count + 1)
    keep = (sizes >= SPECK * sizes.max()) & ((known > 0) | (sizes == sizes.max()))
    keep |= known > 0.3 * sizes
    keep[0] = False
    out = keep[labels]
    holes, number = ndimage.label(~out)
    if number:
        areas = np.bincount(holes.ravel())
        border = np.unique(np.concatenate([holes[0], holes[-1], holes[:, 0], holes[:, -1]]))
        small = areas < max(PINHOLE * out.sum(), 2)
        small[border] = False
        small[0] = False
        out = out | small[holes]
    return out
