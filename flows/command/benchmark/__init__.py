"""``garden benchmark``: one module a benchmark, imported when it is used."""

from __future__ import annotations

import argparse

from flows.command.subcommands import add_subcommands, run_subcommand

BENCHMARKS = {
    "sample": (
        "flows.command.benchmark.sample",
        "the sample capture against its exact truth, end to end",
    ),
    "depth": (
        "flows.command.benchmark.captures",
        "depth beside a plain plane sweep: error and time",
    ),
    "gravity": (
        "flows.command.benchmark.gravity",
        "gravity beside every baseline: test scenes, captures with truth",
    ),
    "classifier": (
        "flows.command.benchmark.classifier",
        "the point classifier beside box, distance, connectivity",
    ),
    "models": (
        "flows.command.benchmark.models",
        "what models cost to load and to run, by number of photos, beside a bare loop",
    ),
    "latency": (
        "flows.command.benchmark.latency",
        "cold, cached and warm seconds a scene, object and step, beside the paper's table",
    ),
    "orchestration": (
        "flows.command.benchmark.orchestration",
        "what a step, a publish and a scene cost beside their peers; a thousand scenes",
    ),
}

DESCRIPTION = """\
Measure the pipeline, or what runs it. Results come from the store where they are there.
`garden benchmark NAME --help` tells what each one measures and how."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the benchmarks and their options."""
    parser.description = DESCRIPTION
    add_subcommands(parser, BENCHMARKS, "name")


def run(options: argparse.Namespace) -> int:
    """Run the benchmark; return the exit code."""
    return run_subcommand(options, BENCHMARKS, "name")
