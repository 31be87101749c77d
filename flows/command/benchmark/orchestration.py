"""``garden benchmark orchestration``: the cost of orchestration beside its peers."""

from __future__ import annotations

import argparse
from pathlib import Path

from flows.benchmark.orchestration.options import PARTS, OrchestrationOptions
from flows.command import EXIT_FAILED, EXIT_OK, print_json, say
from flows.command.store_option import open_store

EPILOG = """\
Exit code 1 if a claim misses its limit. Works in the store's folder, but shares nothing with
it. The peers are an extra: pip install 'garden-scenes[benchmark]'."""


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    default = OrchestrationOptions()
    parser.epilog = EPILOG
    parser.add_argument(
        "--only", nargs="+", choices=PARTS, default=PARTS, help="measure these parts only"
    )
    parser.add_argument("--steps", type=int, default=default.steps, help="steps of the chain (200)")
    parser.add_argument("--repeats", type=int, default=default.repeats, help="repeats (5)")
    parser.add_argument(
        "--gigabytes", type=float, default=default.gigabytes, help="arrays to publish (1)"
    )
    parser.add_argument(
        "--scene", type=Path, default=default.scene, help="capture of the cold scene"
    )
    parser.add_argument(
        "--scenes", type=int, default=default.scenes, help="simulated scenes (1000)"
    )
    parser.add_argument("--objects", type=int, default=default.objects, help="objects a scene (5)")
    parser.add_argument(
        "--processes", type=int, default=default.processes, help="simulated scenes at once (2)"
    )
    parser.add_argument(
        "--server",
        choices=("lean", "full"),
        default=default.server,
        help="the Prefect server's settings for the simulated scenes: lean keeps no events",
    )
    parser.add_argument(
        "--engine",
        choices=("prefect", "local"),
        default=default.engine,
        help="what runs the simulated scenes",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help="write orchestration.md and .json here"
    )


def run(options: argparse.Namespace) -> int:
    """Measure, and print every claim with its limit; return the exit code."""
    from flows.benchmark.orchestration.measure_all import measure_all
    from flows.benchmark.orchestration.peers.all_peers import PeerMissing
    from flows.benchmark.orchestration.scene_overhead import SceneFailed
    from flows.benchmark.orchestration.step_cost import WrongResult

    asked = _asked(options)
    try:
        with open_store(options).scratch() as folder:
            report = measure_all(asked, folder, say)
    except (PeerMissing, WrongResult, SceneFailed) as error:
        say(f"garden: {error}")
        return EXIT_FAILED
    if asked.out is not None:
        report.write(asked.out)
    if options.json:
        print_json(report.to_json())
    else:
        print(report.to_text())
    return EXIT_OK if report.holds else EXIT_FAILED


def _asked(arguments: argparse.Namespace) -> OrchestrationOptions:
    """Return what the user asked for."""
    return OrchestrationOptions(
        parts=tuple(arguments.only),
        steps=arguments.steps,
        repeats=arguments.repeats,
        gigabytes=arguments.gigabytes,
        scene=arguments.scene,
        scenes=arguments.scenes,
        objects=arguments.objects,
        engine=arguments.engine,
        processes=arguments.processes,
        server=arguments.server,
        out=arguments.out,
    )
