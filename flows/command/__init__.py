"""The ``garden`` command. Each subcommand is one module, imported when it is used."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from collections.abc import Sequence

from flows.wrong_use import WrongUse

EXIT_OK, EXIT_FAILED, EXIT_WRONG_USE, EXIT_DEGRADED, EXIT_INTERRUPTED = 0, 1, 2, 3, 130
EXIT_OF_STATUS = {"ok": EXIT_OK, "degraded": EXIT_DEGRADED, "failed": EXIT_FAILED}

COMMANDS = {
    "factorize": "turn a capture into a settled, simulation-ready scene",
    "batch": "run a collection of scenes; what is finished is not run again",
    "status": "tell how a collection stands, also while it runs in another terminal",
    "plan": "tell what factorize would run and why, without running it",
    "why": "tell from which steps and inputs an artifact came",
    "store": "list, check, repair, pin and collect what the artifact store holds",
    "benchmark": "measure depth, gravity and whole scenes against captures with truth",
    "train": "train a network of the pipeline, with its record",
    "doctor": "tell what this machine can run and what is missing",
}

DESCRIPTION = """\
Photos of a room in, a simulation-ready scene out: gravity-aligned, factored into rigid
objects and a clean background, settled in MuJoCo. Runs on a CPU, offline."""

EPILOG = """\
examples:
  garden factorize photos/desk --box mug IMG_0012.jpg 480 300 760 690
  garden factorize photos/desk --targets boxes.json --out scenes
  garden plan photos/desk          what would run, and why
  garden batch night.toml          a collection of scenes, or a folder of captures
  garden status scenes             how it stands, from another terminal
  garden why reconstruct           where the newest reconstruction came from

exit codes: 0 ok, 1 failed, 2 wrong use, 3 degraded (a result, but weaker than asked)"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="garden",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    arguments = list(sys.argv[1:] if argv is None else argv)
    wanted = next((a for a in arguments if not a.startswith("-")), None)
    for name, summary in COMMANDS.items():
        sub = commands.add_parser(
            name, help=summary, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        if name == wanted:
            importlib.import_module(f"flows.command.{name}").configure(sub)
            add_shared_options(sub)
    options = parser.parse_args(arguments)
    module = importlib.import_module(f"flows.command.{options.command}")
    try:
        return int(module.run(options))
    except KeyboardInterrupt:
        return _fail(
            options,
            "stopped; what was finished is in the store: the same command goes on from there",
            EXIT_INTERRUPTED,
        )
    except expected_errors() as error:
        if isinstance(error, OSError):
            return _fail(options, _sentence(error), EXIT_FAILED)
        return _fail(options, str(error), EXIT_WRONG_USE)


def add_shared_options(parser: argparse.ArgumentParser, *, nested: bool = False) -> None:
    """Add the options that every subcommand takes; ``nested`` if a parser above has them too."""
    unset = argparse.SUPPRESS if nested else None
    parser.add_argument(
        "--store",
        metavar="FOLDER|s3://BUCKET/PREFIX",
        default=unset,
        help="artifact store (default: $GARDEN_STORE, else garden/store in the user's cache)",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        default=argparse.SUPPRESS if nested else False,
        help="print one JSON document on standard output",
    )


def print_json(document: object) -> None:
    """Print the one JSON document of ``--json``."""
    json.dump(document, sys.stdout, indent=1)
    sys.stdout.write("\n")


def say(text: str) -> None:
    """Tell the user something, on standard error; a log may keep it, so no secrets."""
    from storage.redact import redact

    print(redact(text), file=sys.stderr, flush=True)


def expected_errors() -> tuple[type[Exception], ...]:
    """Return the errors whose message is for the user."""
    from garden_models.scene import BadGeometry, BadInput
    from storage.errors import StoreError
    from storage.formats.errors import UnreadableInput
    from storage.formats.package import PackageError

    unreachable = ConnectionError, TimeoutError
    return WrongUse, BadInput, BadGeometry, UnreadableInput, StoreError, PackageError, *unreachable


def _sentence(error: OSError) -> str:
    """Return what went wrong with which file, without the number of the error."""
    where = f"{error.filename}: " if error.filename else ""
    return where + (error.strerror or str(error))


def _fail(options: argparse.Namespace, message: str, code: int) -> int:
    from storage.redact import redact

    said = redact(message)
    say(f"garden: {said}")
    if options.json:
        print_json({"status": "failed", "reasons": [said]})
    return code


def _version() -> str:
    from importlib.metadata import version

    return f"garden {version('garden-scenes')}"
