"""Break everything that can break, whole, and print how often it was done and what held.

    python -m tests.faults [PART ...]

The exit code is 1 if an invariant was violated once. Every module of this folder may register
parts (``tests.faults.part``).
"""

from __future__ import annotations

import argparse
import importlib
import pkgutil
import sys
import tempfile
import time
from pathlib import Path

import tests.faults
from tests.faults.part import PARTS, Count

SHOWN = 5


def main(names: list[str]) -> int:
    for module in pkgutil.iter_modules(tests.faults.__path__):
        if not module.name.startswith(("_", "test_")):
            importlib.import_module(f"tests.faults.{module.name}")
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    wanted = parser.parse_args(names).parts
    if unknown := set(wanted) - PARTS.keys():
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    return report({name: run(name) for name in wanted or PARTS})


def run(name: str) -> list[Count]:
    print(f"{name} ...", file=sys.stderr, flush=True)
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="garden-faults-") as folder:
        counts = list(PARTS[name](Path(folder)))
    print(f"{name}: {time.monotonic() - started:.0f} s", file=sys.stderr, flush=True)
    return counts


def report(found: dict[str, list[Count]]) -> int:
    """Print the table; return the exit code."""
    trials = violated = 0
    print(f"{'part':<24} {'what':<40} {'trials':>7} {'violated':>9}")
    for name, counts in found.items():
        for count in counts or [Count("nothing was tried", 0, ("the part is empty",))]:
            trials += count.trials
            violated += len(count.violations)
            verdict = "VIOLATED" if count.violations else "ok"
            print(
                f"{name:<24} {count.what:<40} {count.trials:>7} {len(count.violations):>9}"
                f"  {verdict}"
            )
            for violation in count.violations[:SHOWN]:
                print(f"    {violation}")
    print(f"{'all':<24} {'':<40} {trials:>7} {violated:>9}  {'VIOLATED' if violated else 'ok'}")
    return 1 if violated else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
