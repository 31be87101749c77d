"""``garden benchmark gravity``: ours beside every baseline, as in the paper's gravity table."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store

if TYPE_CHECKING:
    from garden_models.metrics.gravity import MethodErrors

    Scored = tuple[MethodErrors, ...]

EPILOG = """\
Angular error in degrees: mean, 90th percentile, share above 10. error/sigma is 1 for a method
that knows how good it is. Up for down counts 180, no answer 90."""


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.epilog = EPILOG
    parser.add_argument(
        "captures",
        nargs="*",
        type=Path,
        metavar="CAPTURE",
        help="a capture with cameras.json as truth, measured with cameras given and estimated",
    )
    parser.add_argument(
        "--scenes", type=int, default=60, help="procedural test scenes (60; 0: captures only)"
    )
    parser.add_argument(
        "--curves",
        action="store_true",
        help="also against camera roll, number of views and lack of planes",
    )
    parser.add_argument("--weights", metavar="FILE", type=Path, help="a decoder (the shipped)")
    parser.add_argument(
        "--geocalib",
        action="store_true",
        help="compare with GeoCalib as well (`garden doctor` tells what it needs)",
    )


def run(options: argparse.Namespace) -> int:
    """Print a table for every setting; return the exit code."""
    from flows.benchmark.gravity import GravityBenchmark, compare_gravity
    from flows.model_check import check_model
    from flows.terminal_view import TerminalView
    from garden_models.gravity.decoder.shipped import checkpoint_file
    from tasks.step import StepFailed

    if options.geocalib:
        check_model("geocalib")
    path = options.weights or checkpoint_file()
    config = GravityBenchmark(
        tuple(options.captures),
        options.scenes,
        curves=options.curves,
        with_geocalib=options.geocalib,
    )
    try:
        with TerminalView("garden benchmark gravity") as view:
            weights = None if path is None else path.read_bytes()
            scores, curves = compare_gravity(config, weights, open_store(options), view)
    except StepFailed as failure:
        say(f"garden: {failure}")
        return EXIT_FAILED
    if path is None:
        say("no decoder is shipped and none was given (--weights): without it")
    if options.json:
        print_json(_document(scores, curves))
        return EXIT_OK
    _print(scores, curves)
    return EXIT_OK


def _document(scores: dict[str, Scored], curves: dict[str, dict[str, Scored]]) -> dict[str, Any]:
    from flows.training.gravity_record import score_rows

    return {
        "benchmark": "gravity",
        "rows": [
            {"setting": setting, **row}
            for setting, rows in scores.items()
            for row in score_rows(rows)
        ],
        "scenes": [
            {
                "setting": setting,
                "method": row.method,
                "errors_deg": dict(zip(row.scenes, row.errors_deg.round(3).tolist(), strict=True)),
            }
            for setting, rows in scores.items()
            for row in rows
        ],
        "curves": {
            curve: {name: score_rows(rows) for name, rows in found.items()}
            for curve, found in curves.items()
        },
    }


def _print(scores: dict[str, Scored], curves: dict[str, dict[str, Scored]]) -> None:
    from flows.benchmark.captures import table
    from flows.training.gravity_record import score_rows

    for setting, rows in scores.items():
        print(f"{setting}\n{table(score_rows(rows))}\n")
    for curve, found in curves.items():
        print(f"mean error in degrees against {curve}")
        first = next(iter(found.values()))
        lines = [
            {
                "method": row.method,
                **{name: round(rows[k].mean_deg, 2) for name, rows in found.items()},
            }
            for k, row in enumerate(first)
        ]
        print(f"{table(lines)}\n")
