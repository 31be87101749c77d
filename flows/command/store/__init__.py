"""``garden store``: one module an action, imported when it is used."""

from __future__ import annotations

import argparse
import importlib

from flows.command import add_shared_options

ACTIONS = {
    "ls": ("listing", "every step that was computed: scene, verdict, seconds, size"),
    "verify": ("checking", "re-hash every artifact and say what is broken and what to do"),
    "repair": ("checking", "put what is broken into quarantine; it is made again when needed"),
    "gc": ("collecting", "free room: remove what nothing needs, and what was not used for long"),
    "pin": ("pinning", "hold results or whole scenes against gc, under a name"),
    "unpin": ("pinning", "let go of what a pin held"),
    "pins": ("pinning", "what is held, since when and why"),
    "conflicts": ("listing", "results that came out different when made again"),
    "compact": ("collecting", "write the table behind ls and reports anew, as one file"),
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
    actions = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    for name, (module, summary) in ACTIONS.items():
        action = actions.add_parser(
            name,
            help=summary,
            description=summary[0].upper() + summary[1:] + ".",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        _module(module).configure(name, action)
        add_shared_options(action, nested=True)


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    module, _summary = ACTIONS[options.action]
    code: int = _module(module).run(options)
    return code


def _module(name: str):  # type: ignore[no-untyped-def]
    return importlib.import_module(f"flows.command.store.{name}")
