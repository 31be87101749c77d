"""Choose each step's options: a named preset, a TOML file, and single settings."""

from __future__ import annotations

import dataclasses
import tomllib
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from garden_models.scene import BadInput
from garden_models.targets.config import GroundTargets, ProposeTargets
from tasks.align_gravity import AlignGravity
from tasks.align_gravity_by_tokens import TokenGravity
from tasks.clean_background import CleanBackground
from tasks.clean_gaussians import CleanGaussians
from tasks.compose import Compose
from tasks.fuse_prediction import FusePrediction
from tasks.ingest import Ingest
from tasks.label_points import LabelPoints
from tasks.mesh_object import MeshObject
from tasks.place_object import PlaceObject
from tasks.predict_geometry import PhotoGeometry
from tasks.reconstruct import DenseStereo
from tasks.register import Registration
from tasks.render import RenderViews
from tasks.segment import Segment
from tasks.simulate import Simulation


@dataclass(frozen=True)
class Preset:
    """The options of every step; the defaults are the embedded backends (CPU, offline)."""

    ingest: Ingest = field(default_factory=Ingest)
    geometry: PhotoGeometry = field(default_factory=PhotoGeometry)
    register: Registration = field(default_factory=Registration)
    propose: ProposeTargets = field(default_factory=ProposeTargets)
    ground: GroundTargets = field(default_factory=GroundTargets)
    reconstruct: DenseStereo = field(default_factory=DenseStereo)
    fusion: FusePrediction = field(default_factory=FusePrediction)
    gravity: AlignGravity = field(default_factory=AlignGravity)
    token_gravity: TokenGravity = field(default_factory=TokenGravity)
    segment: Segment = field(default_factory=Segment)
    mesh: MeshObject = field(default_factory=MeshObject)
    place: PlaceObject = field(default_factory=PlaceObject)
    disentangle: LabelPoints = field(default_factory=LabelPoints)
    background: CleanBackground = field(default_factory=CleanBackground)
    splats: CleanGaussians = field(default_factory=CleanGaussians)
    physics: Compose = field(default_factory=Compose)
    simulation: Simulation = field(default_factory=Simulation)
    render: RenderViews = field(default_factory=RenderViews)


PRESETS = {
    "embedded": Preset(),
    "foundation": Preset(
        geometry=PhotoGeometry("depth_anything_3", gaussians=True, camera_tokens=True),
        segment=Segment("sam3"),
        mesh=MeshObject("sam3d_objects"),
        place=PlaceObject("foundation_pose"),
    ),
}
"""``foundation`` is the paper's models; gravity has the model's camera tokens as one more cue
once ``token_gravity.weights`` names a decoder of them."""


def read_preset(name_or_file: str, settings: list[str]) -> Preset:
    """Return a named preset or that of a TOML file, changed by ``STEP.OPTION=VALUE`` settings.

    Raises BadInput for an unknown preset, step or option, or a value of the wrong type.
    """
    preset = named_preset(name_or_file)
    for setting in settings:
        path, separator, value = setting.partition("=")
        if not (separator and "." in path):
            raise BadInput(f"--set {setting}: write it as STEP.OPTION=VALUE")
        preset = with_settings(preset, {path: _parsed(value)})
    return preset


def named_preset(name_or_file: str, folder: Path = Path()) -> Preset:
    """Return a named preset or that of a TOML file, whose path is relative to ``folder``."""
    if name_or_file in PRESETS:
        return PRESETS[name_or_file]
    if name_or_file.endswith(".toml"):
        return _from_toml(folder / name_or_file)
    raise BadInput(
        f"no preset called {name_or_file}: use one of {', '.join(PRESETS)} or a .toml file"
    )


def with_settings(preset: Preset, settings: Mapping[str, Any]) -> Preset:
    """Return the preset with some options changed.

    Settings are ``{"reconstruct": {"long_side": 640}}`` or ``{"reconstruct.long_side": 640}``.
    Raises BadInput for an unknown step or option, or a value of the wrong type.
    """
    for name, value in settings.items():
        step, dot, option = name.partition(".")
        options = {option: value} if dot else value
        if not isinstance(options, Mapping):
            raise BadInput(f"{name} is a step: give its options as {name}.OPTION = VALUE")
        preset = _changed(preset, step, options)
    return preset


def _from_toml(path: Path) -> Preset:
    try:
        document = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise BadInput(f"no such preset file: {path}") from None
    except tomllib.TOMLDecodeError as error:
        raise BadInput(f"{path} is not TOML: {error}") from None
    base = document.pop("preset", "embedded")
    if base not in PRESETS:
        raise BadInput(f"{path} builds on the preset {base}: use one of {', '.join(PRESETS)}")
    return with_settings(PRESETS[base], document)


def _changed(preset: Preset, step: str, options: Mapping[str, Any]) -> Preset:
    steps = [f.name for f in dataclasses.fields(preset)]
    if step not in steps:
        raise BadInput(f"no step called {step} in a preset: there are {', '.join(steps)}")
    config = getattr(preset, step)
    types = typing.get_type_hints(type(config))
    known = [f.name for f in dataclasses.fields(config)]
    for option, value in options.items():
        if option not in known:
            raise BadInput(f"{step} has no option {option}: there are {', '.join(known)}")
        typed = _typed(value, types[option], f"{step}.{option}")
        config = dataclasses.replace(config, **{option: typed})
    return dataclasses.replace(preset, **{step: config})


def _parsed(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _typed(value: Any, wanted: Any, name: str) -> Any:
    origin = typing.get_origin(wanted)
    if origin is tuple and isinstance(value, list):
        return tuple(value)
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    simple = {int, float, bool, str}
    if wanted in simple and type(value) is not wanted:
        raise BadInput(f"{name} must be of type {wanted.__name__}, got {value!r}")
    if origin is typing.Literal and value not in typing.get_args(wanted):
        raise BadInput(f"{name} must be one of {typing.get_args(wanted)}, got {value!r}")
    return value
