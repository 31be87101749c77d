"""``garden store``: one module an action, imported when it is used."""

from __future__ import annotations

import argparse

from flows.command.subcommands import add_subcommands, run_subcommand

ACTIONS = {
    "ls": (
        "flows.command.store.listing",
        "every step that was computed: scene, verdict, seconds, size",
    ),
    "verify": (
        "flows.command.store.checking",
        "re-hash every artifact and say what is broken and what to do",
    ),
    "repair": (
        "flows.command.store.checking",
        "put what is broken into quarantine; it is made again when needed",
    ),
    "gc": (
        "flows.command.store.collecting",
        "free room: remove what nothing needs, and what was not used for long",
    ),
    "pin": ("flows.command.store.pinning", "hold results or whole scenes against gc, under a name"),
    "unpin": ("flows.command.store.pinning", "let go of what a pin held"),
    "pins": ("flows.command.store.pinning", "what is held, since when and why"),
    "conflicts": ("flows.command.store.listing", "results that came out different when made again"),
    "compact": (
        "flows.command.store.collecting",
        "write the table behind ls and reports anew, as one file",
    ),
}

DESCRIPTION = """\
The store keeps every step's result, by content: nothing is computed twice, and nothing that
was damaged is ever used. It only grows; `gc` makes it smaller, and what gc removed is simply
computed again when it is needed."""

EPILOG = """\
examples:
  garden store ls --scene kitchen
  garden store gc --dry-run                 what could go without forgetting any result
  garden store gc --quota 50GB              forget the longest unused until 50 GB are left
  garden store gc --unused 30d              forget what nobody used for 30 days
  garden store pin release-1 --scene kitchen --reason "figure 2"
  garden store verify || garden store repair

With GARDEN_STORE_QUOTA=50GB in the environment every run keeps its store under that size by
itself. Exit codes: 0 ok, 1 problems were found or the quota was not reached, 2 wrong use."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the actions and their options."""
    parser.description = DESCRIPTION
    parser.epilog = EPILOG
    add_subcommands(parser, ACTIONS, "action")


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    return run_subcommand(options, ACTIONS, "action")
