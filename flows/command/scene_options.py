"""Read the options that say which scene is meant, for ``factorize`` and ``plan``."""

from __future__ import annotations

import argparse
from pathlib import Path

from flows.command import say
from flows.licence import LICENCES
from flows.preset import read_preset
from flows.proposal_options import add_proposal_options, proposal_options
from flows.scene_request import SceneOptions, read_scene
from flows.scene_run import SceneRequest
from flows.wrong_use import WrongUse
from garden_models.scene import Target
from garden_models.targets.boxes import parse_boxes

SCENES = "scenes"


def add_scene_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that name the capture, its targets, its cameras and the preset."""
    parser.add_argument(
        "capture",
        metavar="CAPTURE",
        help="folder of photos (or with images/ in it), video, transforms.json, COLMAP model, or "
        "a .zip or .tar.gz of one of these",
    )
    parser.add_argument("--name", help="the scene's name (default: the capture's)")
    parser.add_argument(
        "--out", metavar="FOLDER", default=SCENES, help="where the package OUT/NAME goes (scenes)"
    )
    parser.add_argument(
        "--box",
        action="append",
        nargs=6,
        default=[],
        metavar=("NAME", "PHOTO", "X0", "Y0", "X1", "Y1"),
        help="an object to factor out: a box in pixels of one photo; may be repeated",
    )
    parser.add_argument("--targets", metavar="FILE", help="boxes from a file like targets.json")
    add_proposal_options(parser)
    parser.add_argument(
        "--cameras", metavar="FILE", help="known cameras: transforms.json or a COLMAP model"
    )
    parser.add_argument("--preset", default="embedded", help="named preset or a TOML file")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="STEP.OPTION=VALUE",
        dest="settings",
        help="change one option of the preset, e.g. reconstruct.long_side=640",
    )
    add_licence_option(parser)
    parser.add_argument(
        "--force", action="append", default=[], metavar="STEP", help="run a step even if cached"
    )


def add_licence_option(parser: argparse.ArgumentParser) -> None:
    """Add the option that refuses models by their licence."""
    parser.add_argument(
        "--licence",
        choices=LICENCES,
        default="any",
        help="permissive: refuse models whose code or weights forbid commercial use",
    )


def scene_request(options: argparse.Namespace) -> SceneRequest:
    """Check the options and return the scene they ask for, before any work starts."""
    request = read_scene(
        proposal_options(options).applied(
            SceneOptions(
                capture=Path(options.capture),
                out=Path(options.out),
                preset=read_preset(options.preset, options.settings),
                name=options.name,
                cameras=Path(options.cameras) if options.cameras else None,
                targets=_targets(options),
                force=frozenset(options.force),
                licence=options.licence,
            )
        )
    )
    for remark in request.remarks:
        say(f"note: {remark}")
    return request


def _targets(options: argparse.Namespace) -> Path | tuple[Target, ...] | None:
    if options.targets and options.box:
        raise WrongUse("give the targets either with --targets or with --box, not both")
    if options.box:
        return parse_boxes(options.box)
    return Path(options.targets) if options.targets else None
