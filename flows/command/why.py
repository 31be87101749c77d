"""``garden why``: tell from which steps and inputs an artifact came."""

from __future__ import annotations

import argparse
from typing import Any

from flows.command import EXIT_OK, print_json
from flows.command.store_option import open_store
from flows.wrong_use import WrongUse
from storage import ActionRecord, Store
from tasks.step.files import counted, listed, split_files

DESCRIPTION = """\
Tell from which steps, inputs, options and code an artifact came. ARTIFACT is the start of
a key or digest as `garden store ls` or report.json show it, or a step: `mesh_object`,
`mesh_object[mug]` (the newest one)."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Add this command's options."""
    parser.description = DESCRIPTION
    parser.add_argument("artifact", metavar="ARTIFACT|STEP")
    parser.add_argument("--scene", help="only this scene")


def run(options: argparse.Namespace) -> int:
    """Run the command; return the exit code."""
    store = open_store(options, create=False)
    found = [r for r in store.find(options.artifact) if options.scene in (None, r.scene)]
    if not found:
        raise WrongUse(
            f"nothing in {store.address} is called {options.artifact}; see `garden store ls`"
        )
    chain = _chain(found[-1], store)
    if options.json:
        print_json({"artifact": options.artifact, "chain": chain})
        return EXIT_OK
    for entry in chain:
        name = f"{entry['step']}[{entry['target']}]" if entry["target"] else entry["step"]
        print(f"{'  ' * entry['depth']}{name}  {entry['status']}, {entry['seconds']:.2f} s")
        for line in _lines(entry):
            print(f"{'  ' * entry['depth']}    {line}")
    return EXIT_OK


def _lines(entry: dict[str, Any]) -> list[str]:
    """Return what is told of one artifact; its files by name, not by digest."""
    files, settings = split_files(entry["config"])
    names = list(files)
    told = {
        "because": entry["ran_because"],
        "files": f"{counted(names)}: {listed(names)}" if names else "",
        "config": ", ".join(f"{name} {value!r}" for name, value in settings.items()),
        "key": entry["key"],
        "kept": "no: collected, and made again when it is needed" if entry["collected"] else "",
    }
    unknown = [
        f"input   {name} {content[:15]}: not made by a step, or no longer known"
        for name, content in entry["unknown_inputs"].items()
    ]
    return [f"{word:<8}{text}" for word, text in told.items() if text] + entry["reasons"] + unknown


def _chain(record: ActionRecord, store: Store) -> list[dict[str, Any]]:
    """Return the record and everything it was made from, nearest first, each once."""
    makers = _Makers(store)
    chain: list[dict[str, Any]] = []
    seen: set[str] = set()

    def follow(current: ActionRecord, depth: int) -> None:
        if current.key in seen:
            return
        seen.add(current.key)
        inputs = current.parts["inputs"]
        made_by = {name: makers.of(content, current.scene) for name, content in inputs.items()}
        entry = _entry(current, depth)
        entry["collected"] = store.action(current.key) is None
        entry["unknown_inputs"] = {
            name: inputs[name] for name, maker in made_by.items() if maker is None
        }
        chain.append(entry)
        for maker in made_by.values():
            if maker is not None:
                follow(maker, depth + 1)

    follow(record, 0)
    return chain


class _Makers:
    """Find the action that gave a content, also if it was collected since."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._keys = store.makers()
        self._remembered: dict[str, dict[str, ActionRecord]] = {}

    def of(self, content: str, scene: str) -> ActionRecord | None:
        key = self._keys.get(content)
        record = None if key is None else self._store.action(key)
        return record or self._collected(scene).get(content)

    def _collected(self, scene: str) -> dict[str, ActionRecord]:
        if scene not in self._remembered:
            self._remembered[scene] = {
                output.content: record
                for record in self._store.remembered(scene)
                for output in record.outputs.values()
            }
        return self._remembered[scene]


def _entry(record: ActionRecord, depth: int) -> dict[str, Any]:
    return {
        "depth": depth,
        "step": record.step,
        "target": record.label or None,
        "scene": record.scene,
        "status": record.verdict["status"],
        "reasons": list(record.verdict["reasons"]),
        "seconds": sum(record.seconds.values()),
        "key": record.key,
        "content": {name: output.content for name, output in record.outputs.items()},
        "inputs": record.parts["inputs"],
        "config": record.parts["config"],
        "packages": record.parts["packages"],
        "backend": record.backend,
        "ran_because": record.why.get("sentence", ""),
    }
