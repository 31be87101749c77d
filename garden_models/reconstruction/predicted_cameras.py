"""Take a model's cameras for those of the capture, with sparse points that photos agree on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from garden_models.geometry.camera import inside_image, pixel_grid, project, resize_intrinsics
from garden_models.reconstruction.geometry_model import GeometryPrediction, GeometryView
from garden_models.reconstruction.photo_geometry import used_photos
from garden_models.reconstruction.similarity import Similarity
from garden_models.reconstruction.sparse_model import assumed_scale
from garden_models.reconstruction.view_alignment import lift
from garden_models.scene import OK, BadInput, Camera, Capture, Scale, SparseModel, Verdict

MOST_POINTS = 20_000
PER_VIEW = 400
AGREE = 0.05
"""Share of the depth by which two photos' depths of a point may differ."""
FEWEST_AGREEING = 0.1
"""Share of the points that another photo must see where they are said to be."""


@dataclass(frozen=True)
class _Samples:
    """Points with the colour and the index of the photo that each comes from."""

    world: Float[np.ndarray, "n 3"]
    rgb: np.ndarray
    view: np.ndarray


def predicted_cameras(capture: Capture, prediction: GeometryPrediction) -> SparseModel:
    """Return the cameras in metres, with points that at least two photos see alike.

    The scale is that of the known cameras, or what the model says is a metre, or assumed. The
    verdict is failed if hardly a photo's depth agrees with another's. Raises BadInput if the
    prediction is not of this capture.
    """
    used = used_photos(capture)
    if len(used) != len(prediction.views):
        raise BadInput(
            f"the prediction is of {len(prediction.views)} photos, the capture has {len(used)}: "
            "predict again"
        )
    scale = prediction_scale(capture, prediction)
    metres = Similarity(scale.metres_per_unit, np.eye(3), np.zeros(3))
    views = [metres.view(view) for view in prediction.views]
    samples = _sample(capture, views)
    seen = _seen(views, samples)
    confirmed = seen.sum(axis=1) >= 2
    doubts = OK if prediction.verdict.status == "ok" else prediction.verdict
    verdict = doubts.worst(_verdict(confirmed, len(views)))
    points, views_of = samples.world[confirmed], seen[confirmed]
    names = {photo.name for photo, _ in used}
    return SparseModel(
        cameras=_cameras(capture, views),
        unregistered=tuple(p.name for p in capture.photos if p.name not in names),
        points_world=points,
        points_rgb=samples.rgb[confirmed],
        track_start=np.concatenate([[0], np.cumsum(views_of.sum(axis=1))]).astype(np.int64),
        track_views=np.nonzero(views_of)[1].astype(np.int64),
        scale=scale,
        cameras_source="known" if capture.cameras else "estimated",
        verdict=verdict,
    )


def prediction_scale(capture: Capture, prediction: GeometryPrediction) -> Scale:
    """Return how the unit of a prediction is known."""
    if capture.cameras:
        return Scale("known_cameras", 1.0, "the unit of the given cameras is taken as metres")
    if prediction.metric:
        return Scale("metric_depth", 1.0, "the model that predicted depth knows metres")
    depths = np.concatenate([view.depth[view.depth > 0][::97] for view in prediction.views])
    return assumed_scale(depths)


def _sample(capture: Capture, views: list[GeometryView]) -> _Samples:
    """Return a grid of each photo's points, of the surer half of its pixels."""
    count = min(PER_VIEW, max(20, MOST_POINTS // len(views)))
    world, rgb, owner = [], [], []
    for index, ((photo, _), view) in enumerate(zip(used_photos(capture), views, strict=True)):
        height, width = view.depth.shape
        step = max(1, int((height * width / (2 * count)) ** 0.5))
        rows, columns = np.mgrid[step // 2 : height : step, step // 2 : width : step]
        known = view.depth[rows, columns] > 0
        rows, columns = rows[known], columns[known]
        sure = view.confidence[rows, columns]
        use = sure >= (np.median(sure) if len(sure) else 0.0)
        rows, columns = rows[use], columns[use]
        pixels = pixel_grid(height, width)[rows, columns]
        world.append(lift(pixels, view.depth[rows, columns].astype(np.float64), view))
        share = np.array([photo.rgb.shape[1] / width, photo.rgb.shape[0] / height])
        column, row = (pixels * share).astype(np.int64).T
        rgb.append(photo.rgb[row, column])
        owner.append(np.full(len(pixels), index))
    return _Samples(np.concatenate(world), np.concatenate(rgb), np.concatenate(owner))


def _seen(views: list[GeometryView], samples: _Samples) -> Bool[np.ndarray, "n views"]:
    """Tell in which photos each point lies at the depth that is predicted there."""
    seen = np.zeros((len(samples.world), len(views)), bool)
    for index, view in enumerate(views):
        height, width = view.depth.shape
        pixels, z = project(samples.world, view.K, view.camera_from_world)
        inside = np.flatnonzero(inside_image(pixels, (width, height)) & (z > 0))
        column, row = pixels[inside].astype(np.int64).T
        near = np.abs(view.depth[row, column] / z[inside] - 1) < AGREE
        seen[inside[near], index] = True
    seen[np.arange(len(samples.view)), samples.view] = True
    return seen


def _verdict(confirmed: Bool[np.ndarray, " n"], views: int) -> Verdict:
    share = float(confirmed.mean()) if len(confirmed) else 0.0
    if share >= FEWEST_AGREEING:
        return Verdict()
    return Verdict(
        "failed",
        (
            f"of what the model predicts, {share:.0%} lies where another of the {views} photos "
            "sees it: the photos hardly overlap, or the predicted cameras are wrong; take "
            "photos that overlap by more than half",
        ),
    )


def _cameras(capture: Capture, views: list[GeometryView]) -> tuple[Camera, ...]:
    cameras = []
    for (photo, known), view in zip(used_photos(capture), views, strict=True):
        height, width = view.depth.shape
        size = photo.rgb.shape[1], photo.rgb.shape[0]
        cameras.append(
            Camera(
                photo=photo.name,
                size=size,
                K=resize_intrinsics(view.K, (width, height), size),
                camera_from_world=view.camera_from_world,
                distortion=np.zeros(4) if known is None else known.distortion,
            )
        )
    return tuple(cameras)
