"""Hold one plane in inverse depth per pixel; move such fields about."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Bool, Float, Int
from torch import Tensor


@dataclass(frozen=True)
class Planes:
    """A plane in inverse depth per pixel: value at the pixel and slopes per pixel.

    Either whole images or vectors over chosen pixels.
    """

    w: Float[Tensor, "*s"]
    gx: Float[Tensor, "*s"]
    gy: Float[Tensor, "*s"]

    def at(self, index: Int[Tensor, " n"]) -> Planes:
        """Return the planes of the pixels with these flat indices, as vectors."""
        return Planes(*(field.reshape(-1)[index] for field in (self.w, self.gx, self.gy)))

    def flat(self) -> Planes:
        """Return the planes of all pixels as vectors."""
        return Planes(self.w.reshape(-1), self.gx.reshape(-1), self.gy.reshape(-1))


def chosen(where: Bool[Tensor, "h w"], these: Planes, those: Planes) -> Planes:
    """Return ``these`` planes where told, else ``those``."""
    return Planes(
        torch.where(where, these.w, those.w),
        torch.where(where, these.gx, those.gx),
        torch.where(where, these.gy, those.gy),
    )


def shifted(image: Float[Tensor, "h w"], dx: int, dy: int) -> Float[Tensor, "h w"]:
    """Return ``out[y, x] = image[y + dy, x + dx]``, the border repeated."""
    height, width = image.shape
    reach = max(abs(dx), abs(dy))
    padded = F.pad(image[None, None], (reach,) * 4, mode="replicate")[0, 0]
    return padded[reach + dy : reach + dy + height, reach + dx : reach + dx + width]


def resize_planes(planes: Planes, size: tuple[int, int]) -> Planes:
    """Carry planes to another resolution (height, width): each new pixel takes its nearest
    old pixel's plane, evaluated where the new pixel is.
    """
    height, width = size
    old_height, old_width = planes.w.shape
    device = planes.w.device
    y = (torch.arange(height, device=device) + 0.5) * (old_height / height)
    x = (torch.arange(width, device=device) + 0.5) * (old_width / width)
    row, column = y.long().clamp(max=old_height - 1), x.long().clamp(max=old_width - 1)
    dy, dx = (y - row - 0.5)[:, None], (x - column - 0.5)[None, :]

    def pick(field: Tensor) -> Tensor:
        return field[row][:, column]

    gx, gy = pick(planes.gx), pick(planes.gy)
    w = pick(planes.w) + gx * dx + gy * dy
    return Planes(w, gx * (old_width / width), gy * (old_height / height))
