"""``garden benchmark latency``: its options, and what it prints."""

from __future__ import annotations

import argparse
from pathlib import Path
from textwrap import fill
from typing import Any

from flows.benchmark.latency.tables import Table, ours_table, paper_table, scene_table, step_table
from flows.benchmark.latency.timing import DEFINITIONS
from flows.command import EXIT_OF_STATUS, print_json, say
from flows.command.store_option import store_address
from flows.wrong_use import WrongUse

Json = dict[str, Any]

OUT = Path("latency")

DEFINED = "\n".join(
    fill(text, 96, initial_indent=f"  {mode:<8}", subsequent_indent=" " * 10)
    for mode, text in DEFINITIONS.items()
)


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.epilog = (
        "Rendering, which only reports and evaluations need, is left out of the totals:\n"
        + DEFINED
        + "\nExit code 3 if some scenes lack a step, 1 if all do."
    )
    parser.add_argument(
        "captures", nargs="*", type=Path, metavar="COLLECTION|CAPTURE", help="what to measure"
    )
    parser.add_argument(
        "--out", type=Path, default=OUT, metavar="FOLDER", help="where the report goes (latency)"
    )
    parser.add_argument(
        "--engine", choices=("prefect", "local"), default="prefect", help="what runs the scenes"
    )
    how = parser.add_mutually_exclusive_group()
    how.add_argument(
        "--read",
        action="store_true",
        help="read what the store knows and execute nothing (default): cold and cached",
    )
    how.add_argument(
        "--run",
        action="store_true",
        dest="execute",
        help="run every scene cold, cached and warm with a throw-away store in --out",
    )
    parser.add_argument(
        "--repeat", type=int, default=1, metavar="N", help="measure N times, for p50 and p95"
    )
    parser.add_argument(
        "--packages", type=Path, metavar="FOLDER", help="where the scenes' packages are (scenes)"
    )
    parser.add_argument("--preset", help="named preset or a TOML file")
    parser.add_argument(
        "--set", action="append", default=[], metavar="STEP.OPTION=VALUE", dest="settings"
    )


def run(options: argparse.Namespace) -> int:
    """Make the report and print its tables; return the exit code."""
    document = make_report(options)
    if options.json:
        print_json(document)
    else:
        print(report_text(document))
    return EXIT_OF_STATUS[document["status"]]


def make_report(options: argparse.Namespace) -> Json:
    """Make the report that the options ask for; return it."""
    from flows.benchmark.latency.report import LatencyOptions, write_latency_report
    from flows.preset import read_preset

    if options.repeat < 1:
        raise WrongUse(f"--repeat {options.repeat}: measure at least once")
    out = options.out
    preset = None
    if options.preset or options.settings:
        preset = read_preset(options.preset or "embedded", options.settings)
    how = LatencyOptions(options.execute, options.repeat, options.engine, options.packages, preset)
    document = write_latency_report(options.captures, out, store_address(options.store), how, say)
    say(f"report: {out}/latency.html")
    return document


def report_text(document: Json) -> str:
    """Return the report's main tables as text columns."""
    tables = (scene_table, step_table, ours_table, paper_table)
    parts = [f"absent: {line}" for line in document["absent"]]
    parts += [_text(make(document)) for make in tables]
    return "\n\n".join(parts)


def _text(table: Table) -> str:
    lines = [table.header, *table.rows]
    widths = [max(len(line[i]) for line in lines) for i in range(len(table.header))]
    rows = (
        "  ".join(
            cell.ljust(width) if i < table.texts else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        )
        for line in lines
    )
    return "\n".join([f"{table.title}: {table.note}", *(row.rstrip() for row in rows)])
