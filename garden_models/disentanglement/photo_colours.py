"""Look places of a support up in the photos: their colour, or that nothing is there.

What an object hides from one camera another one sees; and where the photos see something
behind a place, the support has ended. Only places that no photo shows have to be invented.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from garden_models.disentanglement.config import LookUp
from garden_models.geometry.camera import inside_image, project


@dataclass(frozen=True)
class PhotoView:
    """A photo, its depth (metres, 0 = none), and the pixels that show removed objects."""

    K: Float[np.ndarray, "3 3"]
    camera_from_gv: Float[np.ndarray, "4 4"]
    rgb: UInt8[np.ndarray, "h w 3"]
    depth: Float[np.ndarray, "h w"]
    objects: Bool[np.ndarray, "h w"]


@dataclass(frozen=True)
class Seen:
    """Per place: its colour (0..255, NaN where no photo shows it), whether photos look
    through it, so that nothing can be there, and the share of the photos it lies in (0..1)
    whose view of it an object blocks.
    """

    rgb: Float[np.ndarray, "n 3"]
    empty: Bool[np.ndarray, " n"]
    blocked: Float[np.ndarray, " n"]


def look_up(
    places_gv: Float[np.ndarray, "n 3"],
    spacing: float,
    views: tuple[PhotoView, ...],
    config: LookUp = LookUp(),
) -> Seen:
    """Return what the photos show at places that are ``spacing`` apart (metres).

    Photos whose depth agrees with a place decide its colour; else photos without depth there,
    if they agree with each other. A pixel of an object or of something nearer does not count.
    """
    count = len(places_gv)
    sure = np.full((len(views), count, 3), np.nan, np.float32)
    unsure = np.full((len(views), count, 3), np.nan, np.float32)
    through, blocked, framed = np.zeros((3, count))
    for i, view in enumerate(views):
        height, width = view.depth.shape
        pixels, z = project(places_gv, view.K, view.camera_from_gv)
        inside = np.flatnonzero(inside_image(pixels, (width, height)))
        column, row = pixels[inside].astype(np.int64).T
        grown = cv2.dilate(
            view.objects.astype(np.uint8), _disc(max(1, round(config.mask_margin * width)))
        )
        framed[inside] += 1
        blocked[inside] += view.objects[row, column]
        free = grown[row, column] == 0
        inside, row, column = inside[free], row[free], column[free]
        depth = view.depth[row, column]
        slack = np.maximum(2 * spacing, config.depth_tolerance * z[inside])
        off = depth - z[inside]
        agrees = (depth > 0) & (np.abs(off) <= slack)
        colour = view.rgb[row, column]
        sure[i, inside[agrees]] = colour[agrees]
        unsure[i, inside[depth == 0]] = colour[depth == 0]
        through[inside] += (depth > 0) & (off > slack)
    rgb, agreeing = _middle(sure)
    unsure_rgb, unsure_count = _middle(unsure)
    spread = _spread(unsure, unsure_rgb)
    use = (agreeing == 0) & (unsure_count >= config.least_unsure) & (spread <= config.most_spread)
    rgb[use] = unsure_rgb[use]
    return Seen(rgb, (through >= 2) & (through > agreeing), blocked / np.maximum(framed, 1))


def _middle(
    colours: Float[np.ndarray, "v n 3"],
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, " n"]]:
    """Return the median colour over the photos (NaN where there is none) and their number."""
    count = np.isfinite(colours[..., 0]).sum(axis=0)
    middle = np.full(colours.shape[1:], np.nan)
    some = count > 0
    if some.any():
        middle[some] = np.nanmedian(colours[:, some], axis=0)
    return middle, count


def _spread(
    colours: Float[np.ndarray, "v n 3"], middle: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, " n"]:
    """Return the median deviation from the middle colour, worst channel; inf if unknown."""
    spread = np.full(len(middle), np.inf)
    some = np.isfinite(middle[:, 0])
    if some.any():
        deviation = np.nanmedian(np.abs(colours[:, some] - middle[some]), axis=0)
        spread[some] = deviation.max(axis=1)
    return spread


def _disc(radius: int) -> UInt8[np.ndarray, "d d"]:
    """Return a disc-shaped structuring element."""
    return np.asarray(
        cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1)), np.uint8
    )
