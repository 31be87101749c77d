"""``garden benchmark``: measure the pipeline against captures with truth."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from flows.benchmark.latency.command import (
    DEFINED,
    add_latency_options,
    make_report,
    report_text,
)
from flows.benchmark.orchestration.options import add_options, from_arguments
from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.benchmark_classifier import add_classifier_options, run_classifier
from flows.command.store_option import open_store
from storage import Store

DESCRIPTION = f"""\
  garden benchmark sample [FOLDER]       the sample capture against its exact truth, end to end
  garden benchmark depth CAPTURE ...     depth with estimated cameras, after one scale a scene,
                                         beside a plain plane sweep: error and time
  garden benchmark gravity CAPTURE ...   gravity with cameras given and with cameras estimated
  garden benchmark classifier            the point classifier beside box, distance, connectivity
  garden benchmark orchestration         what a step, a publish and a scene cost beside their
                                         peers, and a thousand simulated scenes
  garden benchmark latency [COLLECTION|CAPTURE ...] [--run] [--repeat N] [--out FOLDER]
                                         cold, cached and warm seconds a scene, object and step,
                                         beside the paper's table: Parquet, Markdown, HTML

latency leaves rendering, which only reports and evaluations need, out of its totals:
{DEFINED}

depth and gravity need captures with cameras.json (and depth/) as truth. Results come from
the store where they are there. Exit code 1 if a measure of `sample` or `orchestration`
misses its limit. orchestration works in the store's folder, but shares nothing with it."""

SAMPLE = Path("tests/scenes/corner")


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument(
        "name", choices=("sample", "depth", "gravity", "orchestration", "latency", "classifier")
    )
    parser.add_argument("captures", nargs="*", type=Path, metavar="CAPTURE")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FOLDER",
        help="where orchestration.md and .json go (nowhere), or the latency report (latency)",
    )
    parser.add_argument(
        "--engine",
        choices=("prefect", "local"),
        default="prefect",
        help="what runs the scenes of orchestration and latency (prefect)",
    )
    add_options(parser)
    add_latency_options(parser)
    add_classifier_options(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    if options.name == "latency":
        return _latency(options)
    store = open_store(options)
    if options.name == "sample":
        return _sample(options, store)
    if options.name == "orchestration":
        return _orchestration(options, store)
    if options.name == "classifier":
        return run_classifier(options, store)
    from flows.benchmark.captures import depth_rows, gravity_row, table

    rows = []
    for capture in options.captures:
        say(f"measuring {capture.name}")
        if options.name == "depth":
            rows += depth_rows(capture, store)
        else:
            rows.append(gravity_row(capture, store))
    if options.json:
        print_json({"benchmark": options.name, "rows": rows})
    else:
        print(table(rows))
    return EXIT_OK


def _latency(options: argparse.Namespace) -> int:
    document = make_report(options)
    if options.json:
        print_json(document)
    else:
        print(report_text(document))
    return EXIT_OK


def _sample(options: argparse.Namespace, store: Store) -> int:
    from flows.benchmark.captures import reconstructed_scene
    from flows.benchmark.corner_truth import load_corner
    from flows.benchmark.sample import measure_sample

    folder = options.captures[0] if options.captures else SAMPLE
    values = reconstructed_scene(folder, store)
    measures = measure_sample(values, load_corner(folder))
    if options.json:
        print_json([{**dataclasses.asdict(m), "holds": m.holds} for m in measures])
    else:
        for measure in measures:
            print(measure.line())
    return EXIT_OK if all(m.holds for m in measures) else EXIT_FAILED


def _orchestration(options: argparse.Namespace, store: Store) -> int:
    from flows.benchmark.orchestration.measure_all import measure_all
    from flows.benchmark.orchestration.peers.all_peers import PeerMissing
    from flows.benchmark.orchestration.scale import SceneNotOk
    from flows.benchmark.orchestration.scene_overhead import SceneFailed
    from flows.benchmark.orchestration.step_cost import WrongResult

    asked = from_arguments(options)
    try:
        with store.scratch() as folder:
            report = measure_all(asked, folder, say)
    except (PeerMissing, WrongResult, SceneFailed, SceneNotOk) as error:
        say(f"garden: {error}")
        return EXIT_FAILED
    if asked.out is not None:
        report.write(asked.out)
    if options.json:
        print_json(report.to_json())
    else:
        print(report.to_text())
    return EXIT_OK if report.holds else EXIT_FAILED
