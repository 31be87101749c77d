"""Turn registered photos into depth maps and one coloured point cloud.

>>> reconstruction = densify(capture, sparse, DenseStereo())  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from garden_models.progress import Progress, silent
from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.reconstruction.depth_completion import complete
from garden_models.reconstruction.depth_consistency import DepthView, agreement
from garden_models.reconstruction.depth_filter import filter_depth
from garden_models.reconstruction.depth_interpolation import bridge_gaps
from garden_models.reconstruction.fusion import (
    FusedView,
    footprints,
    merge_clouds,
    owned_points,
)
from garden_models.reconstruction.multiview_stereo import (
    ViewMatch,
    coarse_match,
    full_match,
    half_match,
    half_rematch,
    sweep_view,
)
from garden_models.reconstruction.photo_pool import RunForPhotos, photo_pool
from garden_models.reconstruction.planes import Planes
from garden_models.reconstruction.stereo_frame import StereoFrame, stereo_frame
from garden_models.reconstruction.stereo_plan import StereoPlan, plan_stereo
from garden_models.reconstruction.undistort import WorkingView, working_views
from garden_models.scene import (
    BadGeometry,
    Capture,
    PointCloud,
    Reconstruction,
    SparseModel,
    Verdict,
    View,
)


def densify(
    capture: Capture,
    sparse: SparseModel,
    config: DenseStereo = DenseStereo(),
    progress: Progress = silent,
) -> Reconstruction:
    """Estimate a depth map for every registered photo and fuse them to points.

    Depths and points are in the unit of ``sparse`` (metres under its scale). Photos with
    too little in common with others keep an empty depth map, and the verdict says so.
    Raises BadGeometry if fewer than two photos share sparse points or nothing can be
    confirmed, BadInput if a camera's photo is missing from the capture.
    """
    progress(0.0, "shrinking and undistorting photos")
    views = working_views(capture, sparse, config.long_side)
    plan = plan_stereo(views, sparse, config)
    with photo_pool(torch.device(config.device)) as run:
        matches, frames = _match(plan, config, run, progress)
        depths = _confirm(plan, frames, matches, config, run, progress)
        depths = _fill_gaps(plan, depths, matches, config, run, progress)
        cloud = _fuse(plan, depths, config, run, progress)
    progress(1.0, f"{len(cloud)} points")
    return Reconstruction(
        views=tuple(_view(view, depths.get(i)) for i, view in enumerate(views)),
        points_world=cloud,
        sparse_world=sparse.points_world,
        unregistered=sparse.unregistered,
        scale=sparse.scale,
        cameras_source=sparse.cameras_source,
        verdict=sparse.verdict.worst(_verdict(plan, cloud)),
    )


def _frames(plan: StereoPlan, factor: int, config: DenseStereo) -> dict[int, StereoFrame]:
    device = torch.device(config.device)
    return {i: stereo_frame(plan.views[i], factor, device) for i in plan.matchable}


def _match(
    plan: StereoPlan, config: DenseStereo, run: RunForPhotos, progress: Progress
) -> tuple[dict[int, ViewMatch], dict[int, StereoFrame]]:
    """Match all photos level by level; every level starts from what all photos found."""
    photos = plan.matchable

    def partners(i: int, frames: dict[int, StereoFrame]) -> list[StereoFrame]:
        return [frames[j] for j in plan.partners[i]]

    def seeded(i: int, level: int) -> torch.Generator:
        return torch.Generator().manual_seed(config.seed * 1_000_003 + i * 7 + level)

    def told(begin: float, end: float, doing: str) -> Callable[[int], None]:
        return lambda done: progress(begin + (end - begin) * done / len(photos), f"{doing} {done}")

    frames = _frames(plan, 4, config)
    swept = run(
        lambda i: sweep_view(frames[i], partners(i, frames), plan.limits[i], config),
        photos,
        told(0.02, 0.14, "sweeping photo"),
    )
    coarse = run(
        lambda i: coarse_match(
            frames[i],
            partners(i, frames),
            swept[i],
            [swept[j].w for j in plan.partners[i]],
            plan.limits[i],
            config,
            seeded(i, 4),
        ),
        photos,
        told(0.14, 0.24, "matching (quarter size) photo"),
    )
    half_frames = _frames(plan, 2, config)
    first = run(
        lambda i: half_match(
            half_frames[i],
            partners(i, half_frames),
            coarse[i],
            [coarse[j].w for j in plan.partners[i]],
            plan.limits[i],
            seeded(i, 2),
        ),
        photos,
        told(0.24, 0.4, "matching (half size) photo"),
    )
    offered = {
        i: DepthView(half_frames[i], match.matched.planes, match.trust(config.max_cost))
        for i, match in first.items()
    }
    half = run(
        lambda i: half_rematch(
            half_frames[i],
            partners(i, half_frames),
            first[i],
            [offered[j] for j in plan.partners[i]],
            plan.limits[i],
        ),
        photos,
        told(0.4, 0.58, "matching (half size, again) photo"),
    )
    full_frames = _frames(plan, 1, config)
    full = run(
        lambda i: full_match(full_frames[i], partners(i, full_frames), half[i], plan.limits[i]),
        photos,
        told(0.58, 0.85, "matching (full size) photo"),
    )
    return full, full_frames


def _confirm(
    plan: StereoPlan,
    frames: dict[int, StereoFrame],
    matches: dict[int, ViewMatch],
    config: DenseStereo,
    run: RunForPhotos,
    progress: Progress,
) -> dict[int, DepthView]:
    """Keep the depths that other photos agree with; their trust is the confidence."""
    raw = {
        i: DepthView(frames[i], match.matched.planes, match.trust(config.max_cost))
        for i, match in matches.items()
    }

    def confirm(i: int) -> DepthView:
        view, planes = raw[i], raw[i].planes
        agreed = agreement(
            view,
            [raw[j] for j in plan.related(i)],
            config.max_relative,
            config.max_disagreement_px,
        )
        keep = filter_depth(agreed, planes, matches[i].step, config.min_agreeing)
        confidence = view.trust * (agreed.count / (agreed.count + 1)) * keep
        return DepthView(view.frame, Planes(agreed.mean_w, planes.gx, planes.gy), confidence)

    return run(confirm, plan.matchable, lambda done: progress(0.86, "comparing depths"))


def _fill_gaps(
    plan: StereoPlan,
    depths: dict[int, DepthView],
    matches: dict[int, ViewMatch],
    config: DenseStereo,
    run: RunForPhotos,
    progress: Progress,
) -> dict[int, DepthView]:
    """Fill gaps of each photo with what the others confirmed, then what its own surroundings
    carry on.
    """
    small = _frames(plan, 2, config)

    def from_others(i: int) -> DepthView:
        planes, trust = complete(
            depths[i],
            matches[i].matched.cost,
            plan.views[i].rgb,
            small[i],
            [(depths[j], plan.views[j].rgb, small[j]) for j in plan.related(i)],
            config.max_relative,
            config.max_disagreement_px,
        )
        return DepthView(depths[i].frame, planes, trust)

    def from_surroundings(i: int) -> DepthView:
        return bridge_gaps(
            completed[i],
            matches[i],
            small[i],
            [small[j] for j in plan.partners[i]],
            [completed[j] for j in plan.related(i)],
            config.max_relative,
            config.max_disagreement_px,
        )

    completed = run(
        from_others, plan.matchable, lambda done: progress(0.88, "filling gaps from other photos")
    )
    return run(from_surroundings, plan.matchable, lambda done: progress(0.9, "bridging bare gaps"))


def _fuse(
    plan: StereoPlan,
    depths: dict[int, DepthView],
    config: DenseStereo,
    run: RunForPhotos,
    progress: Progress,
) -> PointCloud:
    fused = {i: FusedView(depths[i], plan.views[i].rgb) for i in depths}
    sizes = run(
        lambda i: footprints(depths[i].planes, depths[i].frame), plan.matchable, lambda done: None
    )

    def points(i: int) -> PointCloud:
        others = [(fused[j], sizes[j], j < i) for j in plan.related(i)]
        return owned_points(
            fused[i], sizes[i], others, config.max_relative, config.max_disagreement_px
        )

    clouds = run(points, plan.matchable, lambda done: progress(0.92, "fusing points"))
    progress(0.95, "merging points")
    return merge_clouds([clouds[i] for i in plan.matchable], config.max_points)


def _view(view: WorkingView, found: DepthView | None) -> View:
    shape = view.rgb.shape[:2]
    depth = np.zeros(shape, np.float32)
    confidence = np.zeros(shape, np.float32)
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


def _verdict(plan: StereoPlan, cloud: PointCloud) -> Verdict:
    if len(cloud) == 0:
        raise BadGeometry(
            "No depth was confirmed by a second photo: the photos are blurred, bare or hardly "
            "overlap; take sharper photos with smaller steps between them."
        )
    without = [view.photo for i, view in enumerate(plan.views) if i not in plan.partners]
    if not without:
        return Verdict()
    return Verdict(
        "degraded",
        (f"No depth for {', '.join(without)}: they share too few points with other photos.",),
    )
