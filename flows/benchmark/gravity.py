"""Compare gravity methods in one table: on procedural test scenes and captures with truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from flows.benchmark.truth import TrueCameras, read_true_cameras
from flows.capture import find_capture
from flows.preset import Preset
from flows.training.gravity_scores import Scored, score_conditions, score_curves
from flows.training.run import run_training
from garden_models.gravity.evaluation.conditions import MAIN
from garden_models.gravity.evaluation.methods import DecoderWeights, GravityErrors, GravityEstimates
from garden_models.gravity.evaluation.score import errors_of, joined
from garden_models.metrics.camera_pose import true_from_estimated_rotation
from garden_models.scene import Reconstruction
from storage import Store
from tasks.ingest import ingest
from tasks.reconstruct import reconstruct
from tasks.register import register
from tasks.score_gravity import estimate_gravity
from tasks.step import StepEvent, load

SETTINGS = {"given": "captures, cameras given", "estimated": "captures, cameras estimated"}


@dataclass(frozen=True)
class GravityBenchmark:
    """What to compare: captures with ``cameras.json``, procedural test scenes, curves."""

    captures: tuple[Path, ...] = ()
    scenes: int = 60
    scenes_a_step: int = 10
    curves: bool = False
    with_geocalib: bool = False


def compare_gravity(
    config: GravityBenchmark,
    weights: bytes | None,
    store: Store,
    events: Callable[[StepEvent], None],
) -> tuple[dict[str, Scored], dict[str, dict[str, Scored]]]:
    """Return each setting's errors by method, and those along the robustness curves.

    Raises StepFailed, and WrongUse for a capture without truth.
    """
    decoder = DecoderWeights(weights or b"")
    for folder in config.captures:
        read_true_cameras(truth_folder(folder))

    def body() -> tuple[dict[str, Scored], dict[str, dict[str, Scored]]]:
        scores: dict[str, Scored] = {}
        if config.scenes:
            scores |= score_conditions(
                MAIN, config.scenes, config.scenes_a_step, decoder, config.with_geocalib
            )
        for setting, title in SETTINGS.items():
            parts = tuple(
                _capture_errors(folder, setting == "given", decoder, config.with_geocalib)
                for folder in config.captures
            )
            if parts:
                scores[title] = joined(parts)
        curves = {}
        if config.curves:
            curves = score_curves(
                config.scenes, config.scenes_a_step, decoder, config.with_geocalib
            )
        return scores, curves

    return run_training("benchmark-gravity", store, events, "local", body)


def truth_folder(capture: Path) -> Path:
    """Return where a capture's ``cameras.json`` and ``transforms.json`` are: beside the photos,
    or in ``truth`` as the sample's.
    """
    inside = capture / "truth"
    return inside if (inside / "cameras.json").is_file() else capture


def _capture_errors(
    folder: Path, given: bool, decoder: DecoderWeights, with_geocalib: bool
) -> GravityErrors:
    known = truth_folder(folder)
    truth = read_true_cameras(known)
    capture = find_capture(folder, known / "transforms.json" if given else None)
    photos = ingest(capture.source, Preset().ingest, label=folder.name)
    cameras = register(photos, Preset().register, label=folder.name)
    dense = reconstruct(photos, cameras, Preset().reconstruct, label=folder.name)
    found = load(
        estimate_gravity(dense, decoder, with_geocalib, label=folder.name), GravityEstimates
    )
    down = -truth.up_in_transforms
    if not given:
        down = _true_from_estimated(load(dense, Reconstruction), truth).T @ -truth.up_world
    errors = errors_of(found, down)
    return GravityErrors(found.methods, (folder.name,), errors[:, None], found.sigma_deg[:, None])


def _true_from_estimated(reconstruction: Reconstruction, truth: TrueCameras) -> np.ndarray:
    index = {photo: i for i, photo in enumerate(truth.photos)}
    views = [view for view in reconstruction.views if view.photo in index]
    estimated = np.stack([view.camera_from_world for view in views])
    true = np.stack([truth.camera_from_world[index[view.photo]] for view in views])
    return np.asarray(true_from_estimated_rotation(estimated, true))
