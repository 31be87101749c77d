"""Compare slanted patches of one photo with its partners (bilateral NCC).

A hypothesis per pixel is a plane in inverse depth (``w`` at the pixel, slopes ``gx``, ``gy``
per pixel). Its patch is carried to a partner by the plane-induced map, linearised at the
pixel, so that tables and floors match as well at grazing angles as walls do head-on. Taps that
differ in grey from the centre count less (bilateral weights), which keeps the patch on
one side of an object's outline (Schoenberger et al. 2016, section 4.2).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from jaxtyping import Float, Int
from torch import Tensor

from garden_models.reconstruction.partner_atlas import PartnerAtlas, map_lookup
from garden_models.reconstruction.plane_sweep import NOISE_VARIANCE
from garden_models.reconstruction.planes import Planes
from garden_models.reconstruction.stereo_frame import StereoFrame, homogeneous_pixels

PIXELS_AT_ONCE = 8192  # a chunk's samples stay in the processor's cache
GEOMETRIC_LIMIT_PX = 2.0
GEOMETRIC_WEIGHT = 0.1  # cost per pixel of disagreement with a partner's depth
UNSEEN_COST = 1.0 + GEOMETRIC_LIMIT_PX * GEOMETRIC_WEIGHT + 1e-3
HIDDEN_PENALTY = 0.1  # added cost, times the share of a pixel's views that do not see it


@dataclass(frozen=True)
class PatchShape:
    """A square of (2 radius + 1)^2 pixels sampled every ``stride``; ``colour_sigma`` is the
    grey difference (0..1) at which a tap's weight has fallen to 1/e.
    """

    radius: int
    stride: int
    colour_sigma: float = 0.03

    def offsets(self, device: torch.device) -> Float[Tensor, "taps 2"]:
        """Return the (x, y) offsets of the taps."""
        steps = torch.arange(-self.radius, self.radius + 1, self.stride, device=device)
        y, x = torch.meshgrid(steps.float(), steps.float(), indexing="ij")
        return torch.stack([x.reshape(-1), y.reshape(-1)], dim=1)


@dataclass(frozen=True)
class _Slot:
    """Geometry of each pixel's partner, one column per pixel (or one for all)."""

    which: Int[Tensor, " n"]
    base: Float[Tensor, "3 n"]
    along_x: Float[Tensor, "3 n"]
    along_y: Float[Tensor, "3 n"]
    b: Float[Tensor, "3 n"]
    size: Float[Tensor, "2 n"]
    top: Float[Tensor, " n"]

    def part(self, part: slice) -> _Slot:
        if len(self.which) == 1:
            return _Slot(
                self.which,
                self.base[:, part],
                self.along_x,
                self.along_y,
                self.b,
                self.size,
                self.top,
            )
        return _Slot(
            self.which[part],
            self.base[:, part],
            self.along_x[:, part],
            self.along_y[:, part],
            self.b[:, part],
            self.size[:, part],
            self.top[part],
        )


class PatchCost:
    """The patches around chosen pixels of one photo, and what plane hypotheses for them cost.

    ``views`` names, per pixel, the partners to compare with (rows of indices into the atlas);
    without it all partners are. The cost is the mean over the ``best`` of them.
    """

    def __init__(
        self,
        reference: StereoFrame,
        atlas: PartnerAtlas,
        shape: PatchShape,
        best: int,
        index: Int[Tensor, " n"] | None = None,
        views: Int[Tensor, "slots n"] | None = None,
    ) -> None:
        device = reference.grey.device
        height, width = reference.shape
        self.index = index
        if index is None:
            index = torch.arange(height * width, device=device)
        self.atlas = atlas
        self.count = len(index)
        self.pixels = homogeneous_pixels(height, width, device).reshape(3, -1)[:, index]
        if views is None:
            views = torch.arange(len(atlas), device=device)[:, None]
        self.views = views
        self.best = min(best, len(views))
        self._slots = [self._slot(views[slot]) for slot in range(len(views))]
        offsets = shape.offsets(device)
        self.basis = torch.cat([torch.ones_like(offsets[:, :1]), offsets], dim=1)
        self._prepare_patches(reference.grey, shape, offsets, index)

    def _prepare_patches(
        self, grey: Tensor, shape: PatchShape, offsets: Tensor, index: Tensor
    ) -> None:
        width = grey.shape[1]
        radius = shape.radius
        padded = F.pad(grey[None, None], (radius,) * 4, mode="replicate").reshape(-1)
        row, column = index // width, index % width
        stride = width + 2 * radius
        start = (row + radius) * stride + column + radius
        shifts = [int(dy * stride + dx) for dx, dy in offsets.tolist()]
        patches = torch.stack([padded[start + shift] for shift in shifts])
        spatial = (offsets**2).sum(dim=1) / (2 * max(radius, 1) ** 2)
        centre = grey.reshape(-1)[index]
        weight = torch.exp(-(patches - centre).abs() / shape.colour_sigma - spatial[:, None])
        weight /= weight.sum(dim=0)
        centred = patches - (weight * patches).sum(dim=0)
        self.weight = weight
        self.weighted = weight * centred
        self.variance = (self.weighted * centred).sum(dim=0)

    def texture(self) -> Float[Tensor, " n"]:
        """Return 0 (bare) .. 1 (rich): the share of patch variance that is not noise."""
        return self.variance / (self.variance + NOISE_VARIANCE)

    def per_view(self, planes: Planes) -> Float[Tensor, "slots n"]:
        """Return the cost of vectors of planes for each view slot."""
        out = torch.empty((len(self.views), self.count), device=planes.w.device)
        for start in range(0, self.count, PIXELS_AT_ONCE):
            part = slice(start, start + PIXELS_AT_ONCE)
            here = Planes(planes.w[part], planes.gx[part], planes.gy[part])
            for row, slot in enumerate(self._slots):
                out[row, part] = self._slot_cost(slot.part(part), part, here)
        return out

    def __call__(self, planes: Planes) -> Float[Tensor, " n"]:
        """Return the costs (0..1.2) of vectors of planes.

        They are means over the best views; those that do not see the spot do not count, but
        each of them raises the cost a little, lest planes hide from the photos.
        """
        costs = self.per_view(planes)
        if self.best < len(costs):
            costs = costs.topk(self.best, dim=0, largest=False).values
        hidden = costs >= UNSEEN_COST
        unseen = hidden.sum(dim=0)
        mean = costs.masked_fill(hidden, 0.0).sum(dim=0) / (len(costs) - unseen).clamp(min=1)
        mean += HIDDEN_PENALTY * unseen / len(costs)
        return torch.where(unseen < len(costs), mean, UNSEEN_COST)

    def _slot(self, which: Int[Tensor, " n_or_1"]) -> _Slot:
        atlas = self.atlas
        A = atlas.A.index_select(1, which).unflatten(0, (3, 3))
        base = A[:, 0] * self.pixels[0] + A[:, 1] * self.pixels[1] + A[:, 2]
        return _Slot(
            which=which,
            base=base,
            along_x=A[:, 0],
            along_y=A[:, 1],
            b=atlas.b.index_select(1, which),
            size=atlas.size.index_select(1, which),
            top=atlas.top.index_select(0, which),
        )

    def _slot_cost(self, slot: _Slot, part: slice, planes: Planes) -> Float[Tensor, " n"]:
        atlas, b = self.atlas, slot.b
        numerator = slot.base + b * planes.w
        z = numerator[2]
        front = z > 1e-6
        inverse_z = torch.where(front, z, 1.0).reciprocal_()
        x, y = numerator[0] * inverse_z, numerator[1] * inverse_z
        visible = front & (x > 0) & (x < slot.size[0]) & (y > 0) & (y < slot.size[1])
        x, y = torch.where(visible, x, 0.0), torch.where(visible, y, 0.0)
        # derivatives of the partner's pixel by the reference's x and y along the plane
        along_x = (slot.along_x + b * planes.gx) * inverse_z
        along_y = (slot.along_y + b * planes.gy) * inverse_z
        u, v, su, sv = atlas.to_grid(x, y, slot.top)
        frame = torch.stack(
            [
                u,
                v,
                (along_x[0] - x * along_x[2]) * su,
                (along_x[1] - y * along_x[2]) * sv,
                (along_y[0] - x * along_y[2]) * su,
                (along_y[1] - y * along_y[2]) * sv,
            ]
        )
        cost = self._correlation_cost(frame, part)
        if atlas.inverse_depth is not None:
            seen = map_lookup(atlas, slot.which, x, y)
            parallax = torch.hypot((b[0] - x * b[2]) * inverse_z, (b[1] - y * b[2]) * inverse_z)
            error = ((seen * z - planes.w).abs() * parallax).clamp_(max=GEOMETRIC_LIMIT_PX)
            cost += torch.where(seen > 0, error, GEOMETRIC_LIMIT_PX) * GEOMETRIC_WEIGHT
        return torch.where(visible, cost, UNSEEN_COST)

    def _correlation_cost(self, frame: Float[Tensor, "6 n"], part: slice) -> Float[Tensor, " n"]:
        """Return 1 - correlation, in 0..1, of the patches carried by the given affine maps."""
        taps, count = len(self.basis), frame.shape[1]
        grid = self.basis @ frame.view(3, 2, count).transpose(1, 2).reshape(3, -1)
        values = F.grid_sample(
            self.atlas.image.expand(taps, 1, -1, -1),
            grid.view(taps, 1, count, 2),
            padding_mode="zeros",
            align_corners=False,
        ).view(taps, count)
        covariance = (self.weighted[:, part] * values).sum(dim=0)
        weighted = self.weight[:, part] * values
        mean = weighted.sum(dim=0)
        variance = weighted.mul_(values).sum(dim=0) - mean * mean
        norm = (variance.clamp_(min=0) + NOISE_VARIANCE) * (self.variance[part] + NOISE_VARIANCE)
        return (1 - covariance * torch.rsqrt(norm)).clamp_(0, 1)
