"""Map a target's box from the photo file to a view of the reconstruction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool, Float

from garden_models.scene import BadInput, Reconstruction, Target, View

SAMPLES_PER_SIDE = 9
AT_BORDER = 1.0
"""Within this many pixels of the picture's border a side of a box is the picture's."""
BEYOND = 2.0
"""There the object may go on outside of the picture by this many half boxes."""


@dataclass(frozen=True)
class ViewBox:
    """A target's box in undistorted working pixels of view ``view``, whose (width, height)
    is ``picture``.
    """

    view: int
    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]
    picture: tuple[int, int]

    @property
    def size(self) -> Float[np.ndarray, "2"]:
        """(width, height) in pixels."""
        return self.high - self.low

    def relative(self, pixels: Float[np.ndarray, "*n 2"]) -> Float[np.ndarray, "*n 2"]:
        """Return pixels in units of half the box, from its centre: the border is at 1."""
        return (pixels - (self.low + self.high) / 2) / (self.size / 2)

    def contains(
        self, pixels: Float[np.ndarray, "*n 2"], margin: float = 0.0
    ) -> Bool[np.ndarray, "*n"]:
        """Tell which pixels lie in the box grown by ``margin`` times half its size; a side
        on the picture's border may only seem to end there, and is open to ``BEYOND``.
        """
        beyond = max(margin, BEYOND)
        low = np.where(self.low <= AT_BORDER, beyond, margin)
        high = np.where(self.high >= np.array(self.picture) - AT_BORDER, beyond, margin)
        with np.errstate(invalid="ignore"):
            relative = self.relative(pixels)
            inside: Bool[np.ndarray, "*n"] = (relative >= -1 - low) & (relative <= 1 + high)
        return np.all(inside, axis=-1)

    def grown(self, margin: float) -> ViewBox:
        """Return the box grown by ``margin`` times half its size, within the picture."""
        step = margin * self.size / 2
        limit = np.array(self.picture, float)
        low, high = np.maximum(self.low - step, 0), np.minimum(self.high + step, limit)
        return replace(self, low=low, high=high)


def box_in_view(target: Target, reconstruction: Reconstruction) -> ViewBox:
    """Return the box in its photo's view.

    Raises BadInput if the photo was not registered, or if the box has no area there.
    """
    names = [view.photo for view in reconstruction.views]
    if target.photo not in names:
        state = (
            "could not be registered"
            if target.photo in reconstruction.unregistered
            else ("is not in the capture")
        )
        raise BadInput(
            f"The box of {target.name!r} is on photo {target.photo!r}, which {state}; "
            f"draw it on one of the registered photos, for example {names[0]!r}."
        )
    index = names.index(target.photo)
    low, high = undistorted_box(target.box, reconstruction.views[index])
    if not (high - low >= 2.0).all():
        raise BadInput(
            f"The box of {target.name!r} covers less than two pixels of photo {target.photo!r} "
            f"at the working size; draw a larger box, inside the photo."
        )
    return ViewBox(index, low, high, reconstruction.views[index].size)


def undistorted_box(
    box: tuple[float, float, float, float], view: View
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    """Return (low, high) corners in ``view`` of a box in pixels of the photo file.

    The box is scaled to the working size; its border is then undistorted, and the
    rectangle around that is clipped to the picture.
    """
    share = np.linspace(0.0, 1.0, SAMPLES_PER_SIDE)
    x0, y0, x1, y1 = box
    xs, ys = x0 + (x1 - x0) * share, y0 + (y1 - y0) * share
    border = np.concatenate(
        [
            np.stack([xs, np.full_like(xs, y0)], 1),
            np.stack([xs, np.full_like(xs, y1)], 1),
            np.stack([np.full_like(ys, x0), ys], 1),
            np.stack([np.full_like(ys, x1), ys], 1),
        ]
    )
    border = border * np.array(view.size) / np.array(view.original_size)
    if np.any(view.distortion):
        border = cv2.undistortPoints(
            border[:, None].astype(np.float64), view.K, view.distortion[:4], P=view.K
        )[:, 0]
    limit = np.array(view.size, float)
    return np.clip(border.min(0), 0, limit), np.clip(border.max(0), 0, limit)
