"""Find the boxes that may claim the same points."""

from __future__ import annotations

import numpy as np

from garden_models.progress import Progress, silent
from garden_models.scene import (
    BadGeometry,
    BadInput,
    GravityView,
    PointCloud,
    Reconstruction,
    Rivals,
    Target,
)
from garden_models.segmentation.config import Segment
from garden_models.segmentation.region import BoxView, box_evidence, box_view, points_around
from garden_models.segmentation.scene_in_gv import scene_in_gv

BOTH = 0.04
"""Boxes are rivals if each holds this share of what the other shows."""
EITHER = 0.3
"""They are also if one holds this share, as a table's box does of what stands on it."""

DEFAULT = Segment()


def find_rivals(
    reconstruction: Reconstruction,
    gravity_view: GravityView,
    target: Target,
    others: tuple[Target, ...],
    config: Segment = DEFAULT,
    progress: Progress = silent,
) -> Rivals:
    """Return those of ``others`` whose boxes hold much of what the target's box holds too.

    Points of boxes drawn on different photos can be compared, the boxes cannot. A box
    whose photo is not registered, or that holds nothing, has no say here.

    Raises BadInput or BadGeometry for the target's own box as ``segment`` does.
    """
    scene = scene_in_gv(reconstruction, gravity_view)
    own = box_view(scene, target)
    around = points_around(scene.cloud, own, config)
    rivals = []
    for i, other in enumerate(others):
        progress(i / len(others), f"comparing with {other.name}")
        try:
            box = box_view(scene, other)
            theirs = points_around(scene.cloud, box, config)
        except (BadInput, BadGeometry):
            continue
        if _contested(scene.cloud.subset(np.union1d(around, theirs)), own, box, config):
            rivals.append(other)
    return Rivals(tuple(rivals))


def _contested(around: PointCloud, own: BoxView, other: BoxView, config: Segment) -> bool:
    """Tell whether boxes show the same things, most of all in their middles; views from
    opposite sides show no point in common, so that the boxes themselves are compared.
    """
    mine = box_evidence(around, own, config.box_margin)
    theirs = box_evidence(around, other, config.box_margin)
    shares = [mine.central[theirs.inside].sum(), theirs.central[mine.inside].sum()]
    return bool(min(shares) > BOTH or max(shares) > EITHER)
