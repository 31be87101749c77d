"""Lay the partners' photos out in one image, so that each pixel can look up its own choice."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from garden_models.reconstruction.stereo_frame import StereoFrame, pair_geometry

GAP = 12  # pixels of repeated edge around each photo: patches that overhang stay on their own


@dataclass(frozen=True)
class PartnerAtlas:
    """Partners stacked top to bottom with their geometry to one reference photo.

    ``A`` (9 rows, row-major) and ``b`` have one column per partner; ``size`` holds (width,
    height), ``top`` the atlas row of each partner's first image row. ``inverse_depth``
    (same layout without gaps, 0 = unknown) is the partners' own depth so far.
    """

    image: Float[Tensor, "1 1 atlas_h atlas_w"]
    A: Float[Tensor, "9 partners"]
    b: Float[Tensor, "3 partners"]
    size: Float[Tensor, "2 partners"]
    top: Float[Tensor, " partners"]
    inverse_depth: Float[Tensor, "partners map_h map_w"] | None
    map_size: Float[Tensor, "2 partners"] | None

    def __len__(self) -> int:
        return self.b.shape[1]

    def to_grid(self, x: Tensor, y: Tensor, top: Tensor) -> tuple[Tensor, Tensor, float, float]:
        """Return atlas coordinates in -1..1 and their scales per pixel."""
        height, width = self.image.shape[-2:]
        sx, sy = 2.0 / width, 2.0 / height
        return (x + GAP) * sx - 1, (y + top) * sy - 1, sx, sy


def partner_atlas(
    reference: StereoFrame,
    partners: list[StereoFrame],
    inverse_depths: list[Float[Tensor, "h w"]] | None,
) -> PartnerAtlas:
    """Build the atlas of ``partners`` for a reference photo."""
    device = reference.grey.device
    pairs = [pair_geometry(reference, partner) for partner in partners]
    tall = max(partner.shape[0] for partner in partners)
    wide = max(partner.shape[1] for partner in partners)
    tiles = [_padded(partner.grey, tall, wide) for partner in partners]
    tops = torch.arange(len(partners), device=device) * float(tall + 2 * GAP) + GAP
    maps = map_size = None
    if inverse_depths is not None:
        map_tall = max(len(depth) for depth in inverse_depths)
        map_wide = max(depth.shape[1] for depth in inverse_depths)
        maps = torch.stack(
            [
                F.pad(depth, (0, map_wide - depth.shape[1], 0, map_tall - len(depth)))
                for depth in inverse_depths
            ]
        )
        map_size = torch.tensor(
            [[d.shape[1] for d in inverse_depths], [d.shape[0] for d in inverse_depths]],
            dtype=torch.float32,
            device=device,
        )
    return PartnerAtlas(
        image=torch.cat(tiles)[None, None],
        A=torch.stack([pair.A.reshape(9) for pair in pairs], dim=1),
        b=torch.stack([pair.b for pair in pairs], dim=1),
        size=torch.tensor(
            [[p.shape[1] for p in partners], [p.shape[0] for p in partners]],
            dtype=torch.float32,
            device=device,
        ),
        top=tops,
        inverse_depth=maps,
        map_size=map_size,
    )


def _padded(grey: Float[Tensor, "h w"], tall: int, wide: int) -> Float[Tensor, "h2 w2"]:
    height, width = grey.shape
    pad = (GAP, GAP + wide - width, GAP, GAP + tall - height)
    return F.pad(grey[None, None], pad, mode="replicate")[0, 0]


def map_lookup(
    atlas: PartnerAtlas, which: Int[Tensor, " n"], x: Tensor, y: Tensor
) -> Float[Tensor, " n"]:
    """Return the partners' inverse depths nearest to pixels (x, y) of their photos."""
    assert atlas.inverse_depth is not None and atlas.map_size is not None
    _, rows, columns = atlas.inverse_depth.shape
    scale = (atlas.map_size / atlas.size).index_select(1, which)
    column = (x * scale[0]).long().clamp_(min=0, max=columns - 1)
    row = (y * scale[1]).long().clamp_(min=0, max=rows - 1)
    return atlas.inverse_depth.view(-1).take((which * rows + row) * columns + column)
