"""``garden store``: list or verify what the artifact store holds."""

from __future__ import annotations

import argparse

from flows.command import EXIT_FAILED, EXIT_OK, print_json
from flows.command.scene_options import open_store
from storage import Store

DESCRIPTION = """\
  garden store ls       every step that was computed: scene, step, verdict, seconds, size
  garden store verify   re-hash every artifact and say what is broken (exit code 1 if any)"""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument("action", choices=("ls", "verify"))
    parser.add_argument("--scene", help="only this scene (ls)")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    store = open_store(options, create=False)
    return _list(options, store) if options.action == "ls" else _verify(options, store)


def _list(options: argparse.Namespace, store: Store) -> int:
    records = [r for r in store.actions() if options.scene in (None, r.scene)]
    rows = [
        {
            "scene": record.scene,
            "step": record.step,
            "target": record.label or None,
            "status": record.verdict["status"],
            "seconds": round(sum(record.seconds.values()), 3),
            "bytes": sum(output.bytes for output in record.outputs.values()),
            "key": record.key,
            "content": {name: output.content for name, output in record.outputs.items()},
        }
        for record in records
    ]
    if options.json:
        print_json({"store": store.address, "bytes": store.size(), "actions": rows})
        return EXIT_OK
    for row in rows:
        name = f"{row['step']}[{row['target']}]" if row["target"] else row["step"]
        print(
            f"{row['scene']:<20} {name:<30} {row['status']:<9} {row['seconds']:>8.2f} s "
            f"{row['bytes'] / 1e6:>8.2f} MB  {row['key'][:15]}"
        )
    print(f"{len(rows)} actions, {store.size() / 1e6:.1f} MB in {store.address}")
    return EXIT_OK


def _verify(options: argparse.Namespace, store: Store) -> int:
    problems = list(store.verify(level="full"))
    if options.json:
        print_json({"store": store.address, "problems": [str(p) for p in problems]})
    else:
        for problem in problems:
            print(problem)
        print(f"{len(problems)} problems in {store.address}")
    return EXIT_FAILED if problems else EXIT_OK
