"""``garden train``: train a network of the pipeline, with its record."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store

DESCRIPTION = """\
  garden train point-classifier --preset cpu       which scene points are an object's
  garden train point-classifier --gallery FILE     what its augmentations do, as a page
  garden train point-classifier --fit-stereo DIR   our stereo's noise, from a capture with truth
  garden train gravity --preset cpu                where gravity is, from views of procedural rooms
  garden train gravity --preset paper --backbone DIR --data tartanair=DIR hypersim=DIR vkitti2=DIR
                                                   the paper's, on tokens of Depth-Anything-3

Writes OUT/NAME.safetensors with record.json and record.html. Everything is kept in
the store: data by shards, the training by checkpoints. A training that was stopped or killed
goes on from the last one and ends with the same weights."""

PRESETS = ("smoke", "cpu", "paper")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument("name", choices=("point-classifier", "gravity"))
    parser.add_argument(
        "--preset",
        choices=PRESETS,
        default="cpu",
        help="smoke (minutes), cpu (default: about two hours on two cores), paper (a GPU)",
    )
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="default: trained/NAME-PRESET")
    parser.add_argument("--seed", type=int, default=0, help="of weights and order (0)")
    parser.add_argument("--device", help="torch device (the preset's: cpu)")
    parser.add_argument(
        "--gallery", metavar="FILE", type=Path, help="only write the page of augmentations"
    )
    parser.add_argument(
        "--fit-stereo",
        metavar="FOLDER",
        type=Path,
        help="only fit the stereo-noise augmentation to a capture like tests/scenes/corner",
    )
    parser.add_argument(
        "--backbone",
        metavar="FOLDER",
        type=Path,
        help="Depth-Anything-3's weights: learn gravity from its camera tokens (gravity)",
    )
    parser.add_argument(
        "--data",
        metavar="NAME=FOLDER",
        nargs="+",
        default=[],
        help="data sets for --backbone: tartanair, hypersim, vkitti2 (gravity)",
    )
    parser.add_argument("--engine", choices=("prefect", "local"), default="prefect")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    if options.gallery is not None:
        from flows.training.augmentation_page import write_gallery

        write_gallery(options.gallery, options.preset)
        say(f"wrote {options.gallery}")
        return EXIT_OK
    if options.fit_stereo is not None:
        from flows.training.stereo_residuals import fitted_stereo_noise

        print_json(dataclasses.asdict(fitted_stereo_noise(options.fit_stereo, open_store(options))))
        return EXIT_OK
    if options.name == "gravity":
        from flows.command.train_gravity import train_gravity

        return train_gravity(options)
    return _train(options)


def _train(options: argparse.Namespace) -> int:
    from flows.terminal_view import TerminalView
    from flows.training.command import classifier_preset, train_and_score
    from flows.training.record import score_rows
    from tasks.step import StepFailed

    preset = classifier_preset(options.preset, options.seed, options.device)
    folder = options.out or Path("trained") / f"{options.name}-{preset.name}"
    title = f"garden train {options.name} --preset {preset.name}"
    try:
        with TerminalView(title) as view:
            record, scores = train_and_score(
                preset, folder, open_store(options), view, options.engine
            )
    except StepFailed as failure:
        say(f"garden: {failure}")
        return EXIT_FAILED
    if options.json:
        print_json(record)
    else:
        from flows.benchmark.captures import table

        print(table(score_rows(scores)))
    say(f"{folder}: {record['checkpoint']['bytes']} bytes, digest {record['checkpoint']['digest']}")
    return EXIT_OK
