"""Measure depth on captures that come with ``cameras.json`` and ``depth/``."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from flows.benchmark.plain_plane_sweep import plain_plane_sweep
from flows.benchmark.truth import read_true_cameras, read_true_depth
from flows.capture import find_capture
from flows.factorize import SceneRefs, factorize_scene
from flows.preset import Preset
from flows.report.values import SceneValues, load_values
from flows.scene_run import SceneRequest, SceneResult
from garden_models.metrics.depth import DepthScore, score_depths, truth_at_view
from garden_models.reconstruction.densify import densify
from garden_models.reconstruction.stereo_plan import plan_stereo
from garden_models.reconstruction.undistort import working_views
from garden_models.scene import Capture, SparseModel, Target, View
from garden_models.targets.boxes import parse_targets
from storage import Store
from tasks.ingest import ingest
from tasks.register import register
from tasks.step import Ref, RunContext, load, run_context

Row = dict[str, Any]


def scene_of(folder: Path, package: Path) -> SceneRequest:
    """Return the request for a capture with its own targets and the default preset."""
    capture = find_capture(folder, None)
    targets: tuple[Target, ...] = ()
    if capture.targets_file:
        targets = parse_targets(json.loads(capture.targets_file.read_text("utf-8")))
    return SceneRequest(capture.name, capture.source, targets, Preset(), package)


def reconstructed_scene(folder: Path, store: Store) -> SceneValues:
    """Run the whole pipeline on a capture (or find it in the store) and load everything."""
    request = scene_of(folder, folder)
    with run_context(RunContext(store=store, scene=request.name)) as context:
        refs = factorize_scene(
            request.source, request.targets, Preset(), SceneRefs(request.targets)
        )
        return load_values(SceneResult(request, refs, list(context.outcomes)))


def depth_rows(folder: Path, store: Store) -> list[Row]:
    """Return our depth and a plain plane sweep's, with the same estimated cameras and photos,
    one scale for the scene each, and how long both took, one after the other.
    """
    read_true_cameras(folder)
    with run_context(RunContext(store=store, scene=folder.name)):
        capture, cameras = (load(ref, kind) for ref, kind in _registered(folder, given=False))
    config = Preset().reconstruct
    started = time.perf_counter()
    views = densify(capture, cameras, config).views
    ours = time.perf_counter() - started
    truths = [_true_depth(folder, view) for view in views]
    started = time.perf_counter()
    plan = plan_stereo(working_views(capture, cameras, config.long_side), cameras, config)
    plain = plain_plane_sweep(plan)
    theirs = time.perf_counter() - started
    registered = f"{len(views)}/{len(capture.photos)}"
    methods = [
        ("ours", [view.depth for view in views], ours),
        ("plain sweep", plain, theirs),
    ]
    return [
        {
            "capture": folder.name,
            "registered": registered,
            "method": method,
            **_errors(score_depths(depths, truths)),
            "seconds a view": round(seconds / len(views), 2),
            "times as fast": round(theirs / seconds, 1),
        }
        for method, depths, seconds in methods
    ]


def _errors(score: DepthScore) -> Row:
    return {
        "median error %": round(100 * score.median_relative_error, 3),
        "within 1 % %": round(100 * score.within_1_percent, 1),
        "valid %": round(100 * score.valid, 1),
    }


def _true_depth(folder: Path, view: View) -> np.ndarray:
    """Return the true depth at a view's pixels (all 0 where there is no file)."""
    true = read_true_depth(folder, view.photo)
    if true is None:
        return np.zeros(view.depth.shape)
    return truth_at_view(true, view.K, view.size, view.distortion)


def table(rows: list[Row]) -> str:
    """Return rows as text columns."""
    if not rows:
        return "no captures were given"
    header = list(rows[0])
    lines = [header, *([str(row[name]) for name in header] for row in rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(header))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        for line in lines
    )


def _registered(folder: Path, *, given: bool) -> list[tuple[Ref, Any]]:
    """Return references to a capture and its cameras, with their kinds."""
    capture = find_capture(folder, folder / "transforms.json" if given else None)
    photos = ingest(capture.source, Preset().ingest)
    return [(photos, Capture), (register(photos, Preset().register), SparseModel)]
