"""Tell how well each photo of a COLMAP model is held by points, and drop what is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pycolmap

from garden_models.reconstruction.sparse_model import registered_images

FOCAL_RATIO = (0.2, 5.0)
"""Plausible focal lengths over the photo's longer side (about 11 to 136 degrees)."""

MAX_DISTORTION = 1.0
"""Largest plausible radial distortion coefficient."""


@dataclass(frozen=True)
class PhotoEvidence:
    """``points`` that a photo sees; ``confirmed`` are seen by two other photos as well.

    Points of two photos fit whatever pose their matches suggest; only confirmed points can
    contradict a wrong one.
    """

    photo: str
    points: int
    confirmed: int


def photo_evidence(model: pycolmap.Reconstruction) -> dict[int, PhotoEvidence]:
    """Return the evidence of each registered photo, by image id."""
    points: dict[int, int] = {}
    confirmed: dict[int, int] = {}
    for point in model.points3D.values():
        seen_by = {element.image_id for element in point.track.elements}
        for image_id in seen_by:
            points[image_id] = points.get(image_id, 0) + 1
            confirmed[image_id] = confirmed.get(image_id, 0) + (len(seen_by) >= 3)
    return {
        image.image_id: PhotoEvidence(
            image.name, points.get(image.image_id, 0), confirmed.get(image.image_id, 0)
        )
        for image in registered_images(model)
    }


def drop_unsupported(model: pycolmap.Reconstruction, fewest_confirmed: int) -> None:
    """Take out photos with fewer confirmed points, the weakest first, until none is left.

    Models of two photos have no confirmed points by nature and stay as they are.
    """
    while model.num_reg_images() > 2:
        evidence = photo_evidence(model)
        weakest = min(evidence, key=lambda key: (evidence[key].confirmed, key))
        if evidence[weakest].confirmed >= fewest_confirmed:
            return
        model.deregister_frame(model.images[weakest].frame_id)


def is_plausible(model: pycolmap.Reconstruction) -> bool:
    """Tell whether the model's lenses can exist (a degenerate start bends them instead)."""
    cameras = {image.camera_id for image in registered_images(model)}
    return not any(
        model.cameras[key].has_bogus_params(*FOCAL_RATIO, MAX_DISTORTION) for key in cameras
    )


def supported_models(
    models: Sequence[pycolmap.Reconstruction], fewest_confirmed: int
) -> list[pycolmap.Reconstruction]:
    """Return the plausible models without their unsupported photos, the largest first."""
    kept = []
    for model in models:
        drop_unsupported(model, fewest_confirmed)
        if model.num_points3D() > 0 and is_plausible(model):
            kept.append(model)
    return sorted(kept, key=lambda m: (-m.num_reg_images(), -m.num_points3D()))
