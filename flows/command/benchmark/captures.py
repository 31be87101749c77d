"""``garden benchmark depth``: captures whose truth is known."""

from __future__ import annotations

import argparse
from pathlib import Path

from flows.command import EXIT_OK, print_json, say
from flows.command.store_option import open_store


def configure(name: str, parser: argparse.ArgumentParser) -> None:
    """Add the options."""
    parser.add_argument(
        "captures",
        nargs="+",
        type=Path,
        metavar="CAPTURE",
        help="a capture with cameras.json and depth/ as truth",
    )


def run(options: argparse.Namespace) -> int:
    """Print a table with a row, or one a method, for each capture."""
    from flows.benchmark.captures import depth_rows, table

    store = open_store(options)
    rows = []
    for capture in options.captures:
        say(f"measuring {capture.name}")
        rows += depth_rows(capture, store)
    if options.json:
        print_json({"benchmark": options.name, "rows": rows})
    else:
        print(table(rows))
    return EXIT_OK
