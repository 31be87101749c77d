"""Check predicted depths between photos and fuse them to points, as stereo's are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from garden_models.geometry.camera import resize_intrinsics
from garden_models.progress import Progress, silent
from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.reconstruction.depth_consistency import DepthView, agreement
from garden_models.reconstruction.depth_filter import filter_depth
from garden_models.reconstruction.depth_scale_check import judge_depth_scale
from garden_models.reconstruction.fuse_prediction_config import FusePrediction
from garden_models.reconstruction.fusion import FusedView, footprints, merge_clouds, owned_points
from garden_models.reconstruction.geometry_model import GeometryPrediction, GeometryView
from garden_models.reconstruction.photo_geometry import used_photos
from garden_models.reconstruction.photo_pool import RunForPhotos, photo_pool
from garden_models.reconstruction.plane_fit import surface_planes
from garden_models.reconstruction.planes import Planes
from garden_models.reconstruction.stereo_frame import (
    StereoFrame,
    parallax_per_inverse_depth,
    stereo_frame,
)
from garden_models.reconstruction.stereo_plan import StereoPlan, plan_stereo
from garden_models.reconstruction.undistort import WorkingView, undistort
from garden_models.scene import (
    BadGeometry,
    BadInput,
    Camera,
    Capture,
    Photo,
    PointCloud,
    Reconstruction,
    SparseModel,
    Verdict,
    View,
)


@dataclass(frozen=True)
class _Depths:
    """The views, the plan of which are compared, and each view's frame and depths."""

    plan: StereoPlan
    views: dict[int, DepthView]


def fuse_prediction(
    capture: Capture,
    cameras: SparseModel,
    prediction: GeometryPrediction,
    config: FusePrediction = FusePrediction(),
    progress: Progress = silent,
) -> Reconstruction:
    """Return views with the depths that photos agree on, and their fused points, in metres.

    ``cameras`` are those of ``predicted_cameras`` for the same prediction. Raises BadGeometry
    if nothing is confirmed, BadInput if they do not belong together.
    """
    names = [photo.name for photo, _ in used_photos(capture)]
    registered = [camera.photo for camera in cameras.cameras]
    if registered != names or len(names) != len(prediction.views):
        raise BadInput("cameras and prediction are of different photos: predict again")
    progress(0.0, "shrinking and undistorting photos")
    views = _working_views(capture, cameras, prediction)
    plan = plan_stereo(views, cameras, DenseStereo(partners=config.partners))
    known = _trusted_depths(prediction, cameras.scale.metres_per_unit, config.min_confidence)
    with photo_pool(torch.device(config.device)) as run:
        raw = _raw(plan, prediction, known, config, run)
        progress(0.2, "comparing depths")
        kept = _confirmed(raw, config, run)
        progress(0.6, "fusing points")
        cloud = _fused(plan, kept, config, run)
    verdict = _verdict(plan, raw.views, kept, cloud, config)
    verdict = verdict.worst(judge_depth_scale(views, known, plan.partners))
    progress(1.0, f"{len(cloud)} points")
    return Reconstruction(
        views=tuple(_view(view, kept.get(i)) for i, view in enumerate(views)),
        points_world=cloud,
        sparse_world=cameras.points_world,
        unregistered=cameras.unregistered,
        scale=cameras.scale,
        cameras_source=cameras.cameras_source,
        verdict=cameras.verdict.worst(verdict),
    )


def _working_views(
    capture: Capture, cameras: SparseModel, prediction: GeometryPrediction
) -> tuple[WorkingView, ...]:
    photos = {photo.name: photo for photo in capture.photos}
    return tuple(
        _working_view(photos[camera.photo], camera, view)
        for camera, view in zip(cameras.cameras, prediction.views, strict=True)
    )


def _working_view(photo: Photo, camera: Camera, view: GeometryView) -> WorkingView:
    height, width = view.depth.shape
    return WorkingView(
        photo=photo.name,
        rgb=undistort(photo.rgb, camera.K, camera.distortion, (width, height)),
        K=resize_intrinsics(camera.K, camera.size, (width, height)),
        camera_from_world=camera.camera_from_world,
        original_size=photo.original_size,
        distortion=np.asarray(camera.distortion, np.float64),
    )


def _trusted_depths(
    prediction: GeometryPrediction, metres_per_unit: float, min_confidence: float
) -> tuple[Float[np.ndarray, "h w"], ...]:
    return tuple(
        np.where(view.confidence >= min_confidence, view.depth * np.float32(metres_per_unit), 0)
        for view in prediction.views
    )


def _raw(
    plan: StereoPlan,
    prediction: GeometryPrediction,
    depths: tuple[Float[np.ndarray, "h w"], ...],
    config: FusePrediction,
    run: RunForPhotos,
) -> _Depths:
    device = torch.device(config.device)

    def raw(i: int) -> DepthView:
        known = depths[i] > 0
        w = np.where(known, 1 / np.where(known, depths[i], 1), 0).astype(np.float32)
        trust = np.where(known, prediction.views[i].confidence, 0).astype(np.float32)
        frame = stereo_frame(plan.views[i], 1, device)
        planes = surface_planes(torch.from_numpy(w).to(device))
        return DepthView(frame, planes, torch.from_numpy(trust).to(device))

    return _Depths(plan, run(raw, plan.matchable, lambda done: None))


def _confirmed(raw: _Depths, config: FusePrediction, run: RunForPhotos) -> dict[int, DepthView]:
    """Keep the depths that other photos agree with, and average with theirs."""

    def confirm(i: int) -> DepthView:
        view, planes = raw.views[i], raw.views[i].planes
        others = [raw.views[j] for j in raw.plan.related(i)]
        agreed = agreement(view, others, config.max_relative, config.max_disagreement_px)
        partners = [raw.views[j].frame for j in raw.plan.partners[i]]
        step = config.max_disagreement_px * _step(view.frame, partners, planes)
        keep = filter_depth(agreed, planes, step, min(config.min_agreeing, len(others)))
        keep &= view.trust > 0
        confidence = view.trust * (agreed.count / (agreed.count + 1)) * keep
        return DepthView(view.frame, Planes(agreed.mean_w, planes.gx, planes.gy), confidence)

    return run(confirm, raw.plan.matchable, lambda done: None)


def _step(frame: StereoFrame, partners: list[StereoFrame], planes: Planes) -> torch.Tensor:
    """Return the inverse depth of one pixel of parallax."""
    return 1 / parallax_per_inverse_depth(frame, partners, planes.w)


def _fused(
    plan: StereoPlan, depths: dict[int, DepthView], config: FusePrediction, run: RunForPhotos
) -> PointCloud:
    fused = {i: FusedView(depths[i], plan.views[i].rgb) for i in depths}
    sizes = {i: footprints(view.planes, view.frame) for i, view in depths.items()}

    def points(i: int) -> PointCloud:
        others = [(fused[j], sizes[j], j < i) for j in plan.related(i)]
        return owned_points(
            fused[i], sizes[i], others, config.max_relative, config.max_disagreement_px
        )

    clouds = run(points, plan.matchable, lambda done: None)
    return merge_clouds([clouds[i] for i in plan.matchable], config.max_points)


def _view(view: WorkingView, found: DepthView | None) -> View:
    shape = view.rgb.shape[:2]
    depth, confidence = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    if found is not None:
        w, trust = found.planes.w.cpu().numpy(), found.trust.cpu().numpy()
        valid = (trust > 0) & (w > 0)
        depth[valid] = 1.0 / w[valid]
        confidence[valid] = np.clip(trust[valid], 0, 1)
    return View(
        photo=view.photo,
        rgb=view.rgb,
        depth=depth,
        confidence=confidence,
        K=view.K,
        camera_from_world=view.camera_from_world,
        original_size=view.original_size,
        distortion=view.distortion,
    )


def _verdict(
    plan: StereoPlan,
    raw: dict[int, DepthView],
    kept: dict[int, DepthView],
    cloud: PointCloud,
    config: FusePrediction,
) -> Verdict:
    if len(cloud) == 0:
        raise BadGeometry(
            "No predicted depth was confirmed by a second photo: the photos hardly overlap, or "
            "the predicted cameras are wrong; take photos that overlap by more than half."
        )
    reasons = []
    without = [view.photo for i, view in enumerate(plan.views) if i not in plan.partners]
    if without:
        reasons.append(f"No depth for {', '.join(without)}: no other photo sees the same.")
    sure = sum(int((raw[i].trust > 0).sum()) for i in raw)
    share = sum(int((kept[i].trust > 0).sum()) for i in kept) / max(sure, 1)
    if share < config.min_confirmed:
        reasons.append(
            f"Other photos confirm {share:.0%} of the predicted depth only: cameras or depths "
            "are not to be relied on."
        )
    return Verdict("degraded", tuple(reasons)) if reasons else Verdict()
