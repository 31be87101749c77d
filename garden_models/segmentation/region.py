"""Gather the points around a target's box, and what its box says of them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from garden_models.scene import BadGeometry, PointCloud, Target, View
from garden_models.segmentation.box import ViewBox, box_in_view
from garden_models.segmentation.carrier import BoxEvidence
from garden_models.segmentation.config import Segment
from garden_models.segmentation.scene_in_gv import SceneInGV
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
    scene: SceneInGV, targets: tuple[Target, ...], config: Segment
) -> tuple[tuple[BoxView, ...], PointCloud]:
    """Return the targets' boxes and the points around all of them, thinned evenly if they
    are more than ``max_nodes``.
    """
    boxes = tuple(box_view(scene, target) for target in targets)
    around = [points_around(scene.cloud, box, config) for box in boxes]
    return boxes, _nodes(scene.cloud, boxes, np.unique(np.concatenate(around)), config)


def box_view(scene: SceneInGV, target: Target) -> BoxView:
    """Return the target's box on its view; BadInput if it is not on a registered photo."""
    box = box_in_view(target, scene.reconstruction)
    return BoxView(target, box, scene.reconstruction.views[box.view], scene.cameras[box.view])


def _nodes(
    cloud: PointCloud, boxes: tuple[BoxView, ...], around: Int[np.ndarray, " m"], config: Segment
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


def points_around(cloud: PointCloud, one: BoxView, config: Segment) -> Int[np.ndarray, " m"]:
    """Return the indices of the points in the box grown by ``surroundings`` boxes, from
    ``depth_before`` to ``depth_behind`` box diagonals (in metres at its depth) around its
    front content.

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
    keep = one.inside(seen, 2 * config.surroundings)
    keep &= seen.z > middle - config.depth_before * diagonal
    keep &= seen.z < middle + config.depth_behind * diagonal
    return np.flatnonzero(keep)


def box_evidence(cloud: PointCloud, one: BoxView, margin: float) -> BoxEvidence:
    """Return what a box says of the points."""
    seen = one.project(cloud.xyz)
    inside = one.inside(seen, margin)
    visible = one.sees(cloud, seen)
    area = (cloud.spacing / np.maximum(np.abs(seen.z), 1e-9)) ** 2
    weight = one.centrality(seen) * area * (visible & inside)
    return BoxEvidence(inside, visible, weight / max(float(weight.sum()), 1e-12))
