"""Average the noise out of matched planes without moving edges."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor

from garden_models.reconstruction.patchmatch import Matched
from garden_models.reconstruction.plane_fit import fit_planes

SPREADS = (1, 2)
TOLERANCE_PX = 0.5  # of parallax: single matches are no better than that
COLOUR_SIGMA = 0.06  # grey difference at which a neighbour's say falls to 1/e


def average_out_noise(
    matched: Matched, grey: Float[Tensor, "h w"], step: Float[Tensor, "h w"]
) -> Matched:
    """Replace each plane by the one through its surroundings that lie within half a pixel of
    parallax of it, each weighted by how well it matched.

    ``step`` is the inverse depth of one pixel of parallax.
    """
    trust = (1 - matched.cost).clamp(0, 1) ** 2 + 1e-3
    planes = matched.planes
    for spread in SPREADS:
        planes = fit_planes(planes, grey, trust, TOLERANCE_PX * step, COLOUR_SIGMA, spread)
    return Matched(planes, matched.cost)
