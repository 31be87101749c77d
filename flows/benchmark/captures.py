"""Measure depth and gravity on captures that come with ``cameras.json`` and ``depth/``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from flows.benchmark.truth import TrueCameras, read_true_cameras, read_true_depth
from flows.capture import find_capture
from flows.factorize import SceneRefs, factorize_scene
from flows.preset import Preset
from flows.report.values import SceneValues, load_values
from flows.scene_run import SceneRequest, SceneResult
from garden_models.metrics.camera_pose import true_from_estimated_rotation
from garden_models.metrics.gravity import angular_error_deg
from garden_models.scene import GravityView, Reconstruction, Target
from garden_models.targets.boxes import parse_targets
from storage import Store
from tasks.align_gravity import align_gravity
from tasks.ingest import ingest
from tasks.reconstruct import reconstruct
from tasks.register import register
from tasks.step import RunContext, load, run_context

Row = dict[str, Any]


def reconstructed_scene(folder: Path, store: Store) -> SceneValues:
    """Run the whole pipeline on a capture (or find it in the store) and load everything."""
    capture = find_capture(folder, None)
    targets: tuple[Target, ...] = ()
    if capture.targets_file:
        targets = parse_targets(json.loads(capture.targets_file.read_text("utf-8")))
    request = SceneRequest(capture.name, capture.source, targets, Preset(), folder)
    with run_context(RunContext(store=store, scene=capture.name)) as context:
        refs = factorize_scene(capture.source, targets, Preset(), SceneRefs(targets))
        return load_values(SceneResult(request, refs, list(context.outcomes)))


def depth_row(folder: Path, store: Store) -> Row:
    """Return the error of our depth, with estimated cameras and one scale for the scene."""
    truth = read_true_cameras(folder)
    reconstruction, _ = _upright(folder, store, given=False)
    ratios, valid, known = [], 0, 0
    for view in reconstruction.views:
        true = read_true_depth(folder, view.photo)
        if true is None:
            continue
        true = cv2.resize(true, view.size, interpolation=cv2.INTER_NEAREST_EXACT)
        both = (true > 0) & (view.depth > 0)
        ratios.append(view.depth[both] / true[both])
        valid, known = valid + int(both.sum()), known + int((true > 0).sum())
    ratio = np.concatenate(ratios)
    error = np.abs(ratio / np.median(ratio) - 1)
    return {
        "capture": folder.name,
        "registered": f"{len(reconstruction.views)}/{len(truth.photos)}",
        "median error %": round(100 * float(np.median(error)), 3),
        "within 1 % %": round(100 * float((error < 0.01).mean()), 1),
        "valid %": round(100 * valid / known, 1),
    }


def gravity_row(folder: Path, store: Store) -> Row:
    """Return the angle between our gravity and the true one, cameras given and estimated."""
    truth = read_true_cameras(folder)
    _, given = _upright(folder, store, given=True)
    reconstruction, estimated = _upright(folder, store, given=False)
    turn = _true_from_estimated(reconstruction, truth)
    return {
        "capture": folder.name,
        "given deg": _off(given.down_world, -truth.up_in_transforms),
        "given sigma": round(given.sigma_deg, 2),
        "estimated deg": _off(turn @ estimated.down_world, -truth.up_world),
        "estimated sigma": round(estimated.sigma_deg, 2),
    }


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


def _upright(folder: Path, store: Store, *, given: bool) -> tuple[Reconstruction, GravityView]:
    capture = find_capture(folder, folder / "transforms.json" if given else None)
    preset = Preset()
    with run_context(RunContext(store=store, scene=capture.name)):
        photos = ingest(capture.source, preset.ingest)
        cameras = register(photos, preset.register)
        dense = reconstruct(photos, cameras, preset.reconstruct)
        upright = align_gravity(dense, preset.gravity)
        return load(dense, Reconstruction), load(upright, GravityView)


def _true_from_estimated(reconstruction: Reconstruction, truth: TrueCameras) -> np.ndarray:
    index = {photo: i for i, photo in enumerate(truth.photos)}
    views = [view for view in reconstruction.views if view.photo in index]
    estimated = np.stack([view.camera_from_world for view in views])
    true = np.stack([truth.camera_from_world[index[view.photo]] for view in views])
    return true_from_estimated_rotation(estimated, true)


def _off(down: np.ndarray, true_down: np.ndarray) -> float:
    return round(angular_error_deg(down, true_down), 2)
