"""Say before any work what a scene's models lack on this machine."""

from __future__ import annotations

from flows.licence import models_in
from flows.preset import Preset
from garden_models.scene import BadInput
from tasks.mesh_object import mesh_object
from tasks.model.found import found_model
from tasks.model.weights import weight_files
from tasks.place_object import place_object
from tasks.predict_geometry import predict_geometry
from tasks.segment import segment
from tasks.step import PlanEntry


def check_weights(preset: Preset, with_targets: bool) -> None:
    """Raise BadInput for the first model of the scene's geometry, and of its targets if it has
    any, whose weights are not here; it names the file and its place.
    """
    steps: list[object] = [preset.geometry]
    if with_targets:
        steps += [preset.segment, preset.mesh, preset.place]
    for name in models_in(steps):
        weight_files(name)


def check_runnable(plan: list[PlanEntry], preset: Preset) -> None:
    """Raise BadInput if a step would run here whose model lacks code, weights or device."""
    options = {
        predict_geometry.name: preset.geometry,
        segment.name: preset.segment,
        mesh_object.name: preset.mesh,
        place_object.name: preset.place,
    }
    steps = {entry.step for entry in plan if entry.action == "would run"}
    for name in models_in([options[step] for step in options if step in steps]):
        check_model(name)


def check_model(name: str) -> None:
    """Raise BadInput if a model lacks code, weights or device here."""
    problems = found_model(name).problems
    if problems:
        title = "" if problems[0].startswith(name) else f"{name}: "
        raise BadInput(f"{title}{problems[0]}")
