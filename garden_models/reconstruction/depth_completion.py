"""Fill depths that a photo could not match itself from photos that could.

Shiny or bare parts often match from some sides only. A surface that other photos confirmed
among themselves is carried over where this photo has none, if enough of them put the same
surface there, none looks through it, and the colours are alike. Two are enough where the photo's
own, unconfirmed match is near; three where it failed to match. Where it matched something else
well, that may be an object the others do not see, and the gap stays. Such depths get less
confidence.
"""

from __future__ import annotations

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from garden_models.reconstruction.depth_consistency import DepthView, at_level, see_from
from garden_models.reconstruction.depth_transfer import carry_planes
from garden_models.reconstruction.planes import Planes, chosen
from garden_models.reconstruction.stereo_frame import StereoFrame, homogeneous_pixels

MAX_COLOUR_DIFFERENCE = 30.0  # mean over r, g, b of 0..255 against the mean of the sources
NEAR = 0.03  # relative difference in depth from the photo's own match
UNMATCHED_COST = 0.5  # own cost from which on the photo has no opinion
MIN_SOURCES_NEAR = 2
MIN_SOURCES_UNMATCHED = 3
COMPLETED_CONFIDENCE = 0.5  # of that of the depths it comes from


@torch.no_grad()
def complete(
    target: DepthView,
    target_cost: Float[Tensor, "h w"],
    target_rgb: UInt8[np.ndarray, "h w 3"],
    target_small: StereoFrame,
    sources: list[tuple[DepthView, UInt8[np.ndarray, "h w 3"], StereoFrame]],
    max_relative: float,
    max_pixels: float,
) -> tuple[Planes, Float[Tensor, "h w"]]:
    """Return the target's planes with gaps filled, and its trust: unchanged where it had
    any, between 0 and ``COMPLETED_CONFIDENCE`` where a gap was filled, else 0.

    ``target_cost`` is the matching cost of the target's own planes, confirmed or not.
    ``sources`` are (view, photo, small frame); the surface is carried over at the size of the
    small frames and checked at full size.
    """
    smaller = [at_level(view, small) for view, _, small in sources]
    carried, carried_trust = carry_planes(target_small, smaller)
    carried_view = DepthView(target_small, carried, carried_trust)
    offered = at_level(carried_view, target.frame)
    index = torch.nonzero(((target.trust <= 0) & (offered.trust > 0)).reshape(-1))[:, 0]
    if len(index) == 0:
        return target.planes, target.trust
    trust, w = _confirmed(
        target,
        target_cost,
        target_rgb,
        offered.planes,
        index,
        sources,
        max_relative,
        max_pixels,
    )
    filled = torch.zeros_like(target.trust).reshape(-1)
    filled[index] = trust
    value = offered.planes.w.reshape(-1).clone()
    value[index] = w
    filled = filled.view_as(target.trust)
    planes = Planes(value.view_as(filled), offered.planes.gx, offered.planes.gy)
    return chosen(filled > 0, planes, target.planes), torch.where(filled > 0, filled, target.trust)


def _confirmed(
    target: DepthView,
    target_cost: Float[Tensor, "h w"],
    target_rgb: UInt8[np.ndarray, "h w 3"],
    planes: Planes,
    index: Tensor,
    sources: list[tuple[DepthView, UInt8[np.ndarray, "h w 3"], StereoFrame]],
    max_relative: float,
    max_pixels: float,
) -> tuple[Float[Tensor, " n"], Float[Tensor, " n"]]:
    """Return trust (0 where refused) and mean inverse depth of the offered pixels."""
    height, width = target.frame.shape
    pixels = homogeneous_pixels(height, width, index.device).reshape(3, -1)[:, index]
    w = planes.at(index).w
    count, through = torch.zeros_like(w), torch.zeros_like(w)
    weight, total = torch.full_like(w, 1e-9), 1e-9 * w
    colour = torch.zeros(3, len(w), device=w.device)
    for view, rgb, _ in sources:
        seen = see_from(target.frame, w, pixels, view, max_relative, max_pixels)
        say = seen.trust * seen.agrees
        weight = weight + say
        total = total + say * seen.carried
        theirs = torch.from_numpy(rgb.reshape(-1, 3)).to(w.device)[seen.index].T.float()
        colour += theirs * say
        count += seen.agrees
        through += seen.through
    own = torch.from_numpy(target_rgb.reshape(-1, 3)).to(w.device)[index].T.float()
    alike = (colour / weight - own).abs().mean(dim=0) < MAX_COLOUR_DIFFERENCE
    near = (w / target.planes.at(index).w - 1).abs() < NEAR
    unmatched = target_cost.reshape(-1)[index] > UNMATCHED_COST
    enough = (near & (count >= MIN_SOURCES_NEAR)) | (unmatched & (count >= MIN_SOURCES_UNMATCHED))
    accepted = enough & (through == 0) & alike
    return COMPLETED_CONFIDENCE * weight / count.clamp(min=1) * accepted, total / weight
