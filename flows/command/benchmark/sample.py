"""``garden benchmark sample``: the sample capture against its exact truth."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.store_option import open_store

SAMPLE = Path("tests/scenes/corner")


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.epilog = "Exit code 1 if a measure misses its limit."
    parser.add_argument(
        "folder", nargs="?", type=Path, default=SAMPLE, help=f"the capture ({SAMPLE})"
    )


def run(options: argparse.Namespace) -> int:
    """Print one line a measure; return the exit code."""
    from flows.benchmark.captures import reconstructed_scene
    from flows.benchmark.corner_truth import load_corner
    from flows.benchmark.sample import measure_sample

    values = reconstructed_scene(options.folder, open_store(options))
    measures = measure_sample(values, load_corner(options.folder))
    if options.json:
        print_json([{**dataclasses.asdict(m), "holds": m.holds} for m in measures])
    else:
        for measure in measures:
            print(measure.line())
    return EXIT_OK if all(m.holds for m in measures) else EXIT_FAILED
