"""Gather the points around a target's box, and what its box says of them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from garden_models.scene import BadGeometry, PointCloud, Reconstruction, Target, View
from garden_models.segmentation.box import ViewBox, box_in_view
from garden_models.segmentation.carrier import BoxEvidence
from garden_models.segmentation.config import Segment
from garden_models.segmentation.zbuffer import Projection, front_points, project_points

FRONT = 0.3
"""Share of the box's middle (by weight, near to far) before which the target's depth lies."""


@dataclass(frozen=True)
class BoxView:
    """A box with the view that it was drawn on and that view's camera in GV."""

    target: Target
    box: ViewBox
    view: View
    camera_from_gv: Float[np.ndarray, "4 4"]

    def project(self, xyz: Float[np.ndarray, "n 3"]) -> Projection:
        """Project points into the box's view."""
        return project_points(xyz, self.view.K, self.camera_from_gv, self.view.size)

    def inside(self, seen: Projection, margin: float) -> Bool[np.ndarray, " n"]:
        """Tell which projected points lie in the box grown by ``margin`` half boxes."""
        return self.box.contains(seen.pixels, margin) & (seen.z > 0)

    def centrality(self, seen: Projection) -> Float[np.ndarray, " n"]:
        """Return 1 in the middle of the box, falling to 0.14 at the middle of its sides."""
        relative = np.nan_to_num(self.box.relative(seen.pixels), nan=1e3)
        return np.exp(-2 * (relative**2).sum(-1).clip(0, 1e3))

    def sees(self, cloud: PointCloud, seen: Projection) -> Bool[np.ndarray, " n"]:
        """Tell which points the view sees: nothing lies before them, by its depth or, where
        it has none, by the points themselves.
        """
        front = front_points(cloud, seen, float(self.view.K[0, 0]), self.view.size)
        near = ndimage.minimum_filter(front.z, 3)
        nearest = np.where(self.view.depth > 0, self.view.depth, near).ravel()
        out = seen.flat >= 0
        limit = nearest[seen.flat[out]] + 4 * cloud.spacing[out]
        out[out] = seen.z[out] <= limit
        return out


def boxes_and_nodes(
    reconstruction: Reconstruction,
    cloud: PointCloud,
    cameras: tuple[Float[np.ndarray, "4 4"], ...],
    target: Target,
    rivals: tuple[Target, ...],
    config: Segment,
) -> tuple[tuple[BoxView, ...], PointCloud]:
    """Return the target's box, then those of the rivals that some of its points lie in, and
    the points around all of them; more than ``max_nodes`` are thinned evenly.
    """
    registered = {view.photo for view in reconstruction.views}
    boxes: list[BoxView] = []
    around: list[Int[np.ndarray, " m"]] = []
    # A rival on a photo that is not registered has its own verdict; here it says nothing.
    for one in (target, *(rival for rival in rivals if rival.photo in registered)):
        box = box_in_view(one, reconstruction)
        view = BoxView(one, box, reconstruction.views[box.view], cameras[box.view])
        if boxes and not _overlap(cloud, around[0], boxes[0], view, config.box_margin):
            continue
        index = points_around(
            cloud,
            view,
            surroundings=config.surroundings,
            before=config.depth_before,
            behind=config.depth_behind,
        )
        boxes.append(view)
        around.append(index)
    return tuple(boxes), _nodes(cloud, boxes, np.unique(np.concatenate(around)), config)


def _nodes(
    cloud: PointCloud, boxes: list[BoxView], around: Int[np.ndarray, " m"], config: Segment
) -> PointCloud:
    """Return the points around the boxes, thinned evenly to ``max_nodes``: those in a box
    least, so that two thirds of the nodes, if there are as many points, are in boxes.
    """
    points = cloud.subset(around)
    inside = np.zeros(len(around), bool)
    for box in boxes:
        inside |= box.inside(box.project(points.xyz), config.box_margin)
    parts = []
    for keep, room in ((inside, 2 * config.max_nodes // 3), (~inside, config.max_nodes // 3)):
        part = np.flatnonzero(keep)
        growth = max(len(part) / room, 1.0)
        chosen = part[np.linspace(0, len(part) - 1, int(len(part) / growth)).astype(int)]
        kept = points.subset(chosen)
        parts.append(replace(kept, spacing=kept.spacing * np.sqrt(growth)))
    return PointCloud(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(PointCloud)
        )
    )


def _overlap(
    cloud: PointCloud, around: Int[np.ndarray, " m"], own: BoxView, other: BoxView, margin: float
) -> bool:
    """Tell whether more than a hundredth of the points in one box lie in another's as well."""
    xyz = cloud.xyz[around]
    xyz = xyz[own.inside(own.project(xyz), margin)]
    return bool(other.inside(other.project(xyz), margin).sum() > 0.01 * len(xyz))


def points_around(
    cloud: PointCloud, one: BoxView, *, surroundings: float, before: float, behind: float
) -> Int[np.ndarray, " m"]:
    """Return the indices of the points in the box grown by ``surroundings`` boxes, from
    ``before`` to ``behind`` box diagonals (in metres at its depth) around its front content.

    Raises BadGeometry if no point is seen in the box.
    """
    seen = one.project(cloud.xyz)
    content = np.flatnonzero(one.inside(seen, 0.0) & one.sees(cloud, seen))
    if len(content) == 0:
        raise BadGeometry(
            f"Nothing was reconstructed inside the box of {one.target.name!r} on photo "
            f"{one.target.photo!r}; take more photos of it from nearby viewpoints, or draw the "
            "box on a photo where the object has texture."
        )
    z = seen.z[content]
    weight = one.centrality(seen)[content] * (cloud.spacing[content] / z) ** 2
    order = np.argsort(z)
    total = np.cumsum(weight[order])
    middle = z[order][min(int(np.searchsorted(total, FRONT * total[-1])), len(z) - 1)]
    diagonal = float(np.linalg.norm(one.box.size)) * middle / float(one.view.K[0, 0])
    keep = one.inside(seen, 2 * surroundings)
    keep &= (seen.z > middle - before * diagonal) & (seen.z < middle + behind * diagonal)
    return np.flatnonzero(keep)


def box_evidence(cloud: PointCloud, one: BoxView, margin: float) -> BoxEvidence:
    """Return what a box says of the points."""
    seen = one.project(cloud.xyz)
    inside = one.inside(seen, margin)
    visible = one.sees(cloud, seen)
    area = (cloud.spacing / np.maximum(np.abs(seen.z), 1e-9)) ** 2
    weight = one.centrality(seen) * area * (visible & inside)
    return BoxEvidence(inside, visible, weight / max(float(weight.sum()), 1e-12))
