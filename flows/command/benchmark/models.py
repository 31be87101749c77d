"""``garden benchmark models``: what models cost to load and to run."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store
from flows.wrong_use import WrongUse

EPILOG = """\
Without MODEL, all that this machine can run (`garden doctor` lists them). Exit code 1 if one
that was asked for cannot be measured. Works in the store's folder, but shares nothing with it."""

_SIZE = re.compile(r"(\d+)x(\d+)")


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.epilog = EPILOG
    parser.add_argument("models", nargs="*", metavar="MODEL", help="models by name")
    parser.add_argument(
        "--photos",
        type=int,
        nargs="+",
        default=[2, 4, 8],
        metavar="N",
        help="numbers of photos (2 4 8)",
    )
    parser.add_argument("--size", default="640x480", metavar="WxH", help="of a photo (640x480)")
    parser.add_argument("--repeats", type=int, default=3, help="runs of each, at least 1 (3)")
    parser.add_argument(
        "--random-weights",
        action="store_true",
        help="measure with random weights, for models of which some can be made",
    )
    parser.add_argument("--variant", help="of the random weights (da3-small)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="write models.md and .json here")


def run(options: argparse.Namespace) -> int:
    """Measure, and print the table; return the exit code."""
    from flows.benchmark.models.measure_all import measure_all

    if min([*options.photos, options.repeats]) < 1:
        raise WrongUse("--photos and --repeats must be 1 or more")
    with open_store(options).scratch() as folder:
        report = measure_all(
            names=tuple(options.models),
            photos=tuple(options.photos),
            size=_size(options.size),
            repeats=options.repeats,
            random=options.random_weights,
            variant=options.variant,
            folder=folder,
            say=say,
        )
    if options.out is not None:
        report.write(options.out)
    if options.json:
        print_json(report.to_json())
    else:
        print(report.to_text())
    return EXIT_FAILED if report.failed else EXIT_OK


def _size(text: str) -> tuple[int, int]:
    found = _SIZE.fullmatch(text)
    if found is None or min(int(found[1]), int(found[2])) < 1:
        raise WrongUse(f"--size {text}: write it as WIDTHxHEIGHT, as in 640x480")
    return int(found[1]), int(found[2])
