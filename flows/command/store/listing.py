"""List what was computed, and what came out different."""

from __future__ import annotations

import argparse
from typing import Any

from flows.command import EXIT_OK, print_json
from flows.command.store_option import open_store
from storage import Store
from storage.catalogue import read_columns
from storage.quantities import show_bytes

_COLUMNS = (
    "key", "scene", "step", "label", "status", "output", "content", "object", "bytes",
    "load_s", "compute_s", "publish_s", "wait_s",
)  # fmt: skip


def configure(action: str, parser: argparse.ArgumentParser) -> None:
    """Add the options of ``ls`` and ``conflicts``."""
    parser.add_argument("--scene", help="only this scene")
    parser.add_argument("--step", help="only this step")
    if action == "ls":
        parser.add_argument("--last", type=int, metavar="N", help="only the newest N")


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    store = open_store(options, create=False)
    return _list(options, store) if options.action == "ls" else _conflicts(options, store)


def _list(options: argparse.Namespace, store: Store) -> int:
    found = read_columns(store.medium, *_COLUMNS)
    size = sum({row[7]: row[8] for row in found}.values())
    actions: dict[str, dict[str, Any]] = {}
    for key, scene, step, label, status, output, content, _object, room, *seconds in found:
        if not _is_meant(options, scene, step):
            continue
        row = actions.setdefault(
            key,
            {
                "scene": scene,
                "step": step,
                "target": label or None,
                "status": status,
                "seconds": round(sum(seconds), 3),
                "bytes": 0,
                "key": key,
                "content": {},
            },
        )
        row["bytes"] += room
        row["content"][output] = content
    rows = list(actions.values())
    if options.last is not None:
        rows = rows[-options.last :] if options.last > 0 else []
    if options.json:
        print_json({"store": store.address, "bytes": size, "actions": rows})
        return EXIT_OK
    print("".join(map(_line, rows)), end="")
    print(f"{len(rows)} actions shown; all artifacts take {show_bytes(size)} in {store.address}")
    return EXIT_OK


def _line(row: dict[str, Any]) -> str:
    return (
        f"{row['scene']:<20} {_name(row['step'], row['target']):<30} {row['status']:<9}"
        f" {row['seconds']:>8.2f} s {show_bytes(row['bytes']):>8}  {row['key'][:15]}\n"
    )


def _conflicts(options: argparse.Namespace, store: Store) -> int:
    rows: list[dict[str, Any]] = []
    for second in store.conflicts():
        if not _is_meant(options, second.scene, second.step):
            continue
        first = store.action(second.key)
        rows.append(
            {
                "scene": second.scene,
                "step": second.step,
                "target": second.label or None,
                "key": second.key,
                "started": second.started,
                "host": second.host,
                "content": {name: output.content for name, output in second.outputs.items()},
                "counts": None
                if first is None
                else {name: output.content for name, output in first.outputs.items()},
                "counts_host": None if first is None else first.host,
            }
        )
    if options.json:
        print_json({"store": store.address, "conflicts": rows})
        return EXIT_OK
    for row in rows:
        print(
            f"{row['scene']:<20} {_name(row['step'], row['target']):<30} {row['key'][:15]}"
            f"  made again on {row['host'] or 'an unnamed host'} with another result"
        )
    print(f"{len(rows)} conflicts: such steps are not deterministic; the first result counts")
    return EXIT_OK


def _is_meant(options: argparse.Namespace, scene: str, step: str) -> bool:
    return options.scene in (None, scene) and options.step in (None, step)


def _name(step: str, target: str | None) -> str:
    return f"{step}[{target}]" if target else step
