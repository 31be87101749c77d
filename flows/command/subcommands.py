"""Give a command commands of its own: one module each, with ``configure`` and ``run``."""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Mapping
from typing import Any

from flows.command import add_shared_options

Subcommands = Mapping[str, tuple[str, str]]
"""By name: the module that carries it out, and what it does."""


def add_subcommands(
    parser: argparse.ArgumentParser, subcommands: Subcommands, destination: str
) -> None:
    """Add the subcommands and their options; the chosen name goes to ``destination``."""
    choices = parser.add_subparsers(dest=destination, metavar=destination.upper(), required=True)
    for name, (module, summary) in subcommands.items():
        subparser = choices.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        _imported(module).configure(name, subparser)
        add_shared_options(subparser, nested=True)


def run_subcommand(options: argparse.Namespace, subcommands: Subcommands, destination: str) -> int:
    """Run the chosen subcommand; return the exit code."""
    module, _summary = subcommands[getattr(options, destination)]
    return int(_imported(module).run(options))


def _imported(module: str) -> Any:
    return importlib.import_module(module)
