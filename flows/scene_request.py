"""Make a scene's request of what a user gave: its capture, targets, cameras and options."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from flows.capture import FoundCapture, find_capture
from flows.licence import Licence, check_licence
from flows.model_check import check_weights
from flows.preset import PRESETS, Preset
from flows.scene_run import SceneRequest
from flows.target_proposal import check_proposal, proposes, without_proposal
from flows.wrong_use import WrongUse
from garden_models.foundation import card
from garden_models.scene import Target
from garden_models.targets.boxes import check_name, parse_targets, validate
from storage.formats.errors import UnreadableInput
from storage.formats.limits import read_json


@dataclass(frozen=True)
class SceneOptions:
    """What a user says of one scene, on the command line or in a collection's file.

    ``name`` is the capture's if not given; ``targets`` are a file's or those given, None for
    the ``targets.json`` beside the photos. Where there are none, the preset may have them
    proposed; with ``propose`` it does also where there is a ``targets.json``.
    """

    capture: Path
    out: Path
    preset: Preset = PRESETS["embedded"]
    name: str | None = None
    cameras: Path | None = None
    targets: Path | tuple[Target, ...] | None = None
    propose: bool = False
    force: frozenset[str] = frozenset()
    licence: Licence = "any"


def read_scene(options: SceneOptions) -> SceneRequest:
    """Look at the capture, check everything, and return the scene that is asked for.

    Raises WrongUse, BadInput or UnreadableInput, which name the file and the remedy.
    """
    check_licence(options.preset, options.licence, _variant)
    capture = find_capture(options.capture, options.cameras)
    name = check_name(options.name or capture.name, "scene")
    if options.propose and options.targets is None:
        capture = dataclasses.replace(
            capture, targets_file=None, unused_targets=capture.targets_file
        )
    given = _targets(options.targets, capture)
    preset = options.preset if given is None else without_proposal(options.preset)
    check_proposal(preset)
    targets = given or ()
    check_weights(preset, with_targets=bool(targets) or proposes(preset))
    if capture.sizes:
        validate(targets, capture.sizes)
    return SceneRequest(
        name=name,
        source=capture.source,
        targets=targets,
        preset=preset,
        package=options.out / name,
        remarks=_remarks(capture, targets, preset, options),
        force=options.force,
    )


def _variant(name: str) -> str | None:
    """Return which variant of a model this machine has."""
    from tasks.model.settings import model_settings
    from tasks.model.variant import variant_of

    return variant_of(card(name), model_settings(name).weights)


def _targets(
    given: Path | tuple[Target, ...] | None, capture: FoundCapture
) -> tuple[Target, ...] | None:
    """Return the targets that were given, None if none were."""
    if isinstance(given, tuple):
        return given
    path = given or capture.targets_file
    if path is None:
        return None
    try:
        return parse_targets(read_json(path))
    except FileNotFoundError:
        raise WrongUse(f"no such targets file: {path}") from None
    except UnreadableInput:
        raise
    except ValueError as error:
        raise WrongUse(f"{path} is not JSON ({error}): see README for its form") from None


def _remarks(
    capture: FoundCapture, targets: tuple[Target, ...], preset: Preset, options: SceneOptions
) -> tuple[str, ...]:
    remarks = []
    if not targets and not proposes(preset):
        remarks.append(
            "no targets were given, so nothing was factored out (give some with --box NAME PHOTO "
            "X0 Y0 X1 Y1 or a targets.json)"
        )
    if options.propose and not proposes(preset):
        remarks.append("targets were given, so none were proposed")
    if capture.unused_targets:
        remarks.append(
            f"{capture.unused_targets.name} lies beside the photos but was not used, since targets "
            "are proposed"
        )
    if capture.unused_cameras:
        remarks.append(
            f"{capture.unused_cameras.name} lies beside the photos but was not used; give it with "
            "--cameras to use it"
        )
    return tuple(remarks)
