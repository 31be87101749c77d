"""Plan dense stereo: which photos are matched with which, over which depths."""

from __future__ import annotations

from dataclasses import dataclass

from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.reconstruction.undistort import WorkingView
from garden_models.reconstruction.view_selection import (
    inverse_depth_range,
    select_views,
    visibility,
)
from garden_models.scene import BadGeometry, SparseModel


@dataclass(frozen=True)
class StereoPlan:
    """Photos at working size; for those that can be matched, by index into ``views``,
    their partners (best first) and their range of inverse depth (far, near).
    """

    views: tuple[WorkingView, ...]
    partners: dict[int, tuple[int, ...]]
    limits: dict[int, tuple[float, float]]

    @property
    def matchable(self) -> list[int]:
        """Indices of the photos that have partners."""
        return list(self.partners)

    def related(self, i: int) -> list[int]:
        """Return the photos that were compared with photo i, either way."""
        reverse = {j for j, theirs in self.partners.items() if i in theirs}
        return sorted(reverse | set(self.partners[i]))


def plan_stereo(
    views: tuple[WorkingView, ...], sparse: SparseModel, config: DenseStereo
) -> StereoPlan:
    """Choose partners and depth ranges from the sparse points.

    Raises BadGeometry if no two photos share enough of them.
    """
    seen = visibility(sparse)
    chosen = select_views(views, sparse, config.partners)
    limits = {}
    for i, view in enumerate(views):
        reach = inverse_depth_range(view, sparse.points_world, seen[i], config.range_margin)
        if reach is not None:
            limits[i] = reach
    partners = mutual({i: chosen[i] for i in limits})
    if len(partners) < 2:
        raise BadGeometry(
            f"No two of the {len(views)} registered photos share enough points for dense "
            "stereo: take more photos that overlap by at least two thirds."
        )
    return StereoPlan(views, partners, limits)


def mutual(chosen: dict[int, tuple[int, ...]]) -> dict[int, tuple[int, ...]]:
    """Drop partners that cannot be matched themselves, until all that remain can."""
    while True:
        kept = {i: tuple(j for j in theirs if j in chosen) for i, theirs in chosen.items()}
        kept = {i: theirs for i, theirs in kept.items() if theirs}
        if kept == chosen:
            return kept
        chosen = kept
