"""A scene of the real flow's shape whose steps publish small artifacts and compute nothing.

Eight steps a scene and five an object, in the order of ``flows.factorize``, under the same
names; every artifact is 4 KB and depends on all that it was made from.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float

from garden_models.scene import Target
from tasks.step import Ref, Step, StepFailed, fan_out, step

SAMPLES = 512
STEPS_A_SCENE, STEPS_AN_OBJECT = 8, 5


@dataclass(frozen=True)
class Simulated:
    """Stands for the result of any step."""

    SCHEMA: ClassVar[str] = "benchmark.Simulated/1"
    samples: Float[np.ndarray, " n"]


@dataclass(frozen=True)
class SimulatedOptions:
    """The options of any step; ``gain`` keeps two steps' results from being equal."""

    gain: float


def _begin(number: int) -> Simulated:
    """Return what stands for the photos of scene ``number``."""
    return Simulated(np.random.default_rng(number).standard_normal(SAMPLES))


def _follow(inputs: tuple[Simulated, ...], config: SimulatedOptions) -> Simulated:
    """Return what stands for the result of a scene's step."""
    return Simulated(config.gain * np.mean([value.samples for value in inputs], axis=0))


def _follow_target(
    target: Target, inputs: tuple[Simulated, ...], config: SimulatedOptions
) -> Simulated:
    """Return what stands for the result of an object's step."""
    summed = np.sum([value.samples for value in inputs], axis=0)
    return Simulated(config.gain * np.roll(summed, int(target.box[0])))


def _scene_step(name: str) -> Step:
    return step(version=1, name=name, packages=("numpy",))(_follow)


def _object_step(name: str) -> Step:
    return step(version=1, name=name, packages=("numpy",))(_follow_target)


ingest = step(version=1, name="ingest", packages=("numpy",))(_begin)
register = _scene_step("register")
reconstruct = _scene_step("reconstruct")
align_gravity = _scene_step("align_gravity")
find_rivals = _object_step("find_rivals")
segment = _object_step("segment")
mesh_object = _object_step("mesh_object")
place_object = _object_step("place_object")
label_points = _object_step("label_points")
clean_background = _scene_step("clean_background")
compose = _scene_step("compose")
simulate = _scene_step("simulate")
render = _scene_step("render")


def simulated_scene(number: int, objects: int = 5) -> Ref:
    """Run the steps of scene ``number``, all of its objects; return the last one's result.

    Raises StepFailed.
    """
    photos = ingest(number)
    cameras = register((photos,), SimulatedOptions(1.01))
    dense = reconstruct((photos, cameras), SimulatedOptions(1.02))
    upright = align_gravity((dense,), SimulatedOptions(1.03))
    targets = [
        Target(f"object_{index}", "photo_00.jpg", (float(index), 0.0, index + 1.0, 1.0))
        for index in range(objects)
    ]
    factored = fan_out(lambda target: simulated_object(target, dense, upright), targets)
    parts = tuple(_not_failed(part) for part in factored)
    background = clean_background((dense, upright, *parts), SimulatedOptions(1.04))
    scene = compose((dense, upright, *parts, background), SimulatedOptions(1.05))
    motion = simulate((scene,), SimulatedOptions(1.06))
    return render((dense, upright, background, scene, motion), SimulatedOptions(1.07))


def _not_failed(part: Ref | StepFailed) -> Ref:
    if isinstance(part, StepFailed):
        raise part
    return part


def simulated_object(target: Target, dense: Ref, upright: Ref) -> Ref:
    """Run the five steps of one object; return the last one's result."""
    rivals = find_rivals(target, (dense, upright), SimulatedOptions(1.08))
    masks = segment(target, (dense, upright, rivals), SimulatedOptions(1.09))
    mesh = mesh_object(target, (dense, upright, masks), SimulatedOptions(1.10))
    placement = place_object(target, (dense, upright, masks, mesh), SimulatedOptions(1.11))
    return label_points(target, (dense, upright, masks, mesh, placement), SimulatedOptions(1.12))


def steps_of(objects: int) -> int:
    """Return how many steps a scene with so many objects has."""
    return STEPS_A_SCENE + STEPS_AN_OBJECT * objects
