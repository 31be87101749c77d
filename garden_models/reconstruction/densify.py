"""Turn registered photos into depth maps and one coloured point cloud.

>>> reconstruction = densify(capture, sparse, DenseStereo())  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from garden_models.progress import Progress, silent
from garden_models.reconstruction.dense_stereo import DenseStereo
from garden_models.reconstruction.depth_consistency import Agreement, DepthView, agreement
from garden_models.reconstruction.depth_filter import filter_depth
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
    sweep_view,
)
from garden_models.reconstruction.patch_cost import Planes
from garden_models.reconstruction.stereo_frame import StereoFrame, stereo_frame
from garden_models.reconstruction.undistort import WorkingView, working_views
from garden_models.reconstruction.view_selection import (
    inverse_depth_range,
    select_views,
    visibility,
)
from garden_models.scene import (
    BadGeometry,
    Capture,
    PointCloud,
    Reconstruction,
    SparseModel,
    Verdict,
    View,
)

Item = TypeVar("Item")


@dataclass(frozen=True)
class _Plan:
    """What is known before matching: photos, their partners, their depth ranges."""

    views: tuple[WorkingView, ...]
    partners: dict[int, tuple[int, ...]]
    limits: dict[int, tuple[float, float]]

    @property
    def matchable(self) -> list[int]:
        """Indices of the photos that have partners and a depth range."""
        return list(self.partners)

    def related(self, i: int) -> list[int]:
        """Return the photos that were compared with photo i, either way."""
        reverse = {j for j, theirs in self.partners.items() if i in theirs}
        return sorted(reverse | set(self.partners[i]))


def densify(
    capture: Capture,
    sparse: SparseModel,
    config: DenseStereo = DenseStereo(),
    progress: Progress = silent,
) -> Reconstruction:
    """Estimate a depth map for every registered photo and fuse them to points.

    Depths and points are in the unit of ``sparse`` (metres under its scale). Photos with
    too little in common with others keep an empty depth map, and the verdict says so.
    Raises BadGeometry if fewer than two photos share sparse points, BadInput if a camera's
    photo is missing from the capture.
    """
    progress(0.0, "shrinking and undistorting photos")
    views = working_views(capture, sparse, config.long_side)
    plan = _plan(views, sparse, config)
    with _workers(config) as run:
        matches, frames = _match_all(plan, config, run, progress)
        depths, confidences = _check_all(plan, frames, matches, config, run, progress)
        cloud = _fuse_all(plan, depths, confidences, config, run, progress)
    progress(1.0, f"{len(cloud)} points")
    return Reconstruction(
        views=tuple(_view(i, view, depths, confidences) for i, view in enumerate(views)),
        points_world=cloud,
        sparse_world=sparse.points_world,
        unregistered=sparse.unregistered,
        scale=sparse.scale,
        cameras_source=sparse.cameras_source,
        verdict=sparse.verdict.worst(_verdict(plan, cloud)),
    )


def _plan(views: tuple[WorkingView, ...], sparse: SparseModel, config: DenseStereo) -> _Plan:
    seen = visibility(sparse)
    chosen = select_views(sparse, config.partners)
    limits = {}
    for i, view in enumerate(views):
        reach = inverse_depth_range(view, sparse.points_world, seen[i], config.range_margin)
        if reach is not None:
            limits[i] = reach
    partners = {i: tuple(j for j in chosen[i] if j in limits) for i in limits}
    partners = {i: theirs for i, theirs in partners.items() if theirs}
    if len(partners) < 2:
        raise BadGeometry(
            f"No two of the {len(views)} registered photos share enough points for dense "
            "stereo: take more photos that overlap by at least two thirds."
        )
    return _Plan(views, partners, limits)


RunAll = Callable[[Callable[[int], Item], list[int], Callable[[int], None]], dict[int, Item]]


@contextmanager
def _workers(config: DenseStereo) -> Iterator[RunAll]:
    """Yield a function that runs a job for many photos, one photo per processor.

    Photos are independent within a stage, so running them side by side with one torch thread
    each uses the processors better than torch's own threads, with the same result.
    """
    threads = torch.get_num_threads()
    on_cpu = torch.device(config.device).type == "cpu"
    pool = ThreadPoolExecutor(
        max_workers=threads if on_cpu else 1, initializer=torch.set_num_threads, initargs=(1,)
    )

    def run(
        job: Callable[[int], Item], indices: list[int], done: Callable[[int], None]
    ) -> dict[int, Item]:
        results = {}
        for count, (i, result) in enumerate(zip(indices, pool.map(job, indices), strict=True)):
            results[i] = result
            done(count + 1)
        return results

    try:
        yield run
    finally:
        pool.shutdown(cancel_futures=True)
        torch.set_num_threads(threads)


def _match_all(
    plan: _Plan, config: DenseStereo, run: RunAll, progress: Progress
) -> tuple[dict[int, ViewMatch], dict[int, StereoFrame]]:
    device = torch.device(config.device)
    photos = plan.matchable
    everyone = sorted(set(photos) | {j for theirs in plan.partners.values() for j in theirs})

    def frames_at(factor: int) -> dict[int, StereoFrame]:
        return {i: stereo_frame(plan.views[i], factor, device) for i in everyone}

    def partners_of(i: int, of: dict[int, Item]) -> list[Item]:
        return [of[j] for j in plan.partners[i]]

    def seeded(i: int, level: int) -> torch.Generator:
        return torch.Generator().manual_seed(config.seed * 1_000_003 + i * 7 + level)

    def told(start: float, share: float, doing: str) -> Callable[[int], None]:
        return lambda done: progress(start + share * done / len(photos), f"{doing} {done}")

    frames = frames_at(4)
    swept = run(
        lambda i: sweep_view(frames[i], partners_of(i, frames), plan.limits[i], config),
        photos,
        told(0.02, 0.12, "sweeping photo"),
    )
    coarse = run(
        lambda i: coarse_match(
            frames[i],
            partners_of(i, frames),
            swept[i],
            [swept[j].w for j in plan.partners[i]],
            plan.limits[i],
            config,
            seeded(i, 4),
        ),
        photos,
        told(0.14, 0.12, "matching (quarter size) photo"),
    )
    half_frames = frames_at(2)
    half = run(
        lambda i: half_match(
            half_frames[i],
            partners_of(i, half_frames),
            coarse[i],
            [coarse[j].w for j in plan.partners[i]],
            plan.limits[i],
            seeded(i, 2),
        ),
        photos,
        told(0.26, 0.24, "matching (half size) photo"),
    )
    full_frames = frames_at(1)
    full = run(
        lambda i: full_match(
            full_frames[i],
            partners_of(i, full_frames),
            half[i],
            [half[j].w for j in plan.partners[i]],
            plan.limits[i],
        ),
        photos,
        told(0.5, 0.36, "matching (full size) photo"),
    )
    return full, full_frames


def _check_all(
    plan: _Plan,
    frames: dict[int, StereoFrame],
    matches: dict[int, ViewMatch],
    config: DenseStereo,
    run: RunAll,
    progress: Progress,
) -> tuple[dict[int, DepthView], dict[int, Tensor]]:
    """Keep the depths that other photos confirm; return them with their confidences."""
    raw = {
        i: DepthView(frames[i], match.matched.planes, match.trust(config.max_cost))
        for i, match in matches.items()
    }

    def check(i: int) -> Agreement:
        others = [raw[j] for j in plan.related(i)]
        return agreement(raw[i], others, config.max_relative, config.max_disagreement_px)

    agreements = run(check, plan.matchable, lambda done: progress(0.88, "comparing depths"))
    depths, confidences = {}, {}
    for i, agreed in agreements.items():
        step = matches[i].step
        keep = filter_depth(agreed, matches[i].matched.planes, step, config.min_agreeing)
        planes = matches[i].matched.planes
        kept = Planes(agreed.mean_w, planes.gx, planes.gy)
        confidence = raw[i].trust * (agreed.count / (agreed.count + 1)) * keep
        depths[i] = DepthView(frames[i], kept, keep.float())
        confidences[i] = confidence.clamp(0, 1)
    return depths, confidences


def _fuse_all(
    plan: _Plan,
    depths: dict[int, DepthView],
    confidences: dict[int, Tensor],
    config: DenseStereo,
    run: RunAll,
    progress: Progress,
) -> PointCloud:
    fused = {i: FusedView(depths[i], plan.views[i].rgb, confidences[i]) for i in depths}
    sizes = {i: footprints(depths[i].planes, depths[i].frame) for i in depths}

    def points(i: int) -> PointCloud:
        others = [(fused[j], sizes[j], j < i) for j in plan.related(i)]
        return owned_points(
            fused[i], sizes[i], others, config.max_relative, config.max_disagreement_px
        )

    clouds = run(points, plan.matchable, lambda done: progress(0.92, "fusing points"))
    progress(0.95, "merging points")
    return merge_clouds([clouds[i] for i in plan.matchable], config.max_points)


def _view(
    i: int, view: WorkingView, depths: dict[int, DepthView], confidences: dict[int, Tensor]
) -> View:
    shape = view.rgb.shape[:2]
    depth = np.zeros(shape, np.float32)
    confidence = np.zeros(shape, np.float32)
    if i in depths:
        w = depths[i].planes.w.cpu().numpy()
        valid = (depths[i].trust.cpu().numpy() > 0) & (w > 0)
        depth[valid] = 1.0 / w[valid]
        confidence[valid] = confidences[i].cpu().numpy()[valid]
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


def _verdict(plan: _Plan, cloud: PointCloud) -> Verdict:
    if len(cloud) == 0:
        raise BadGeometry(
            "No depth was confirmed by a second photo: the photos are blurred, bare or hardly "
            "overlap; take sharper photos with smaller steps between them."
        )
    without = [v.photo for i, v in enumerate(plan.views) if i not in plan.partners]
    if not without:
        return Verdict()
    return Verdict(
        "degraded",
        (f"No depth for {', '.join(without)}: they share too few points with other photos.",),
    )
