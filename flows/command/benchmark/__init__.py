"""``garden benchmark``: one module a benchmark, imported when it is used."""

from __future__ import annotations

import argparse
import importlib

from flows.command import add_shared_options

BENCHMARKS = {
    "sample": ("sample", "the sample capture against its exact truth, end to end"),
    "depth": ("captures", "depth beside a plain plane sweep: error and time"),
    "gravity": ("gravity", "gravity beside every baseline: test scenes, captures with truth"),
    "classifier": ("classifier", "the point classifier beside box, distance, connectivity"),
    "latency": (
        "latency",
        "cold, cached and warm seconds a scene, object and step, beside the paper's table",
    ),
    "orchestration": (
        "orchestration",
        "what a step, a publish and a scene cost beside their peers; a thousand scenes",
    ),
}

DESCRIPTION = """\
Measure the pipeline, or what runs it. Results come from the store where they are there.
`garden benchmark NAME --help` tells what each one measures and how."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the benchmarks and their options."""
    parser.description = DESCRIPTION
    names = parser.add_subparsers(dest="name", metavar="NAME", required=True)
    for name, (module, summary) in BENCHMARKS.items():
        benchmark = names.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        _module(module).configure(name, benchmark)
        add_shared_options(benchmark, nested=True)


def run(options: argparse.Namespace) -> int:
    """Run the benchmark; return the exit code."""
    module, _summary = BENCHMARKS[options.name]
    code: int = _module(module).run(options)
    return code


def _module(name: str):  # type: ignore[no-untyped-def]
    return importlib.import_module(f"flows.command.benchmark.{name}")
