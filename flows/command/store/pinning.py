"""Hold results against collection, and let them go."""

from __future__ import annotations

import argparse
import time

from flows.command import EXIT_OK, print_json
from flows.command.store_option import open_store
from flows.wrong_use import WrongUse
from storage import Pin, Store

_PIN = """\
Hold results against gc, under a NAME of your choice, until it is unpinned. ARTIFACT is what
`garden why` takes: a step (`kitchen/mesh_object[mug]`, the newest one) or the start of a key
or digest. --scene holds all that a scene stands on, also what it gets later."""


def configure(action: str, parser: argparse.ArgumentParser) -> None:
    """Add the options of ``pin``, ``unpin`` and ``pins``."""
    if action == "pins":
        return
    parser.add_argument("name", metavar="NAME")
    if action == "pin":
        parser.description = _PIN
        parser.add_argument("artifacts", metavar="ARTIFACT", nargs="*")
        parser.add_argument("--scene", action="append", default=[], help="may be repeated")
        parser.add_argument("--reason", default="", help="for those who read `garden store pins`")


def run(options: argparse.Namespace) -> int:
    """Run the action; return the exit code."""
    store = open_store(options, create=False)
    action = {"pin": _pin, "unpin": _unpin, "pins": _pins}[options.action]
    return action(options, store)


def _pin(options: argparse.Namespace, store: Store) -> int:
    if not options.artifacts and not options.scene:
        raise WrongUse("name what to hold: an ARTIFACT, or a scene with --scene")
    digests = [_key(store, artifact) for artifact in options.artifacts]
    for scene in options.scene:
        if not any(True for _ in store.latest_of_scene(scene)):
            raise WrongUse(f"nothing in {store.address} belongs to a scene {scene}")
    pin = store.pin(options.name, digests, scenes=options.scene, reason=options.reason)
    if options.json:
        print_json(_document(pin))
    else:
        print(_line(pin))
    return EXIT_OK


def _key(store: Store, artifact: str) -> str:
    found = store.find(artifact)
    if not found:
        raise WrongUse(f"nothing in {store.address} is called {artifact}; see `garden store ls`")
    return found[-1].key


def _unpin(options: argparse.Namespace, store: Store) -> int:
    if not store.unpin(options.name):
        raise WrongUse(f"there is no pin {options.name}; see `garden store pins`")
    if options.json:
        print_json({"unpinned": options.name})
    else:
        print(f"{options.name} holds nothing any more")
    return EXIT_OK


def _pins(options: argparse.Namespace, store: Store) -> int:
    pins = store.pins()
    if options.json:
        print_json({"store": store.address, "pins": [_document(pin) for pin in pins]})
        return EXIT_OK
    for pin in pins:
        print(_line(pin))
    print(f"{len(pins)} pins in {store.address}")
    return EXIT_OK


def _line(pin: Pin) -> str:
    since = time.strftime("%Y-%m-%d %H:%M", time.localtime(pin.created))
    what = [f"scene {scene}" for scene in pin.scenes] + [digest[:15] for digest in pin.digests]
    owner = f" (process {pin.owner.pid} on {pin.owner.host})" if pin.owner else ""
    reason = f": {pin.reason}" if pin.reason else ""
    return f"{pin.name:<24} since {since}  {', '.join(what)}{owner}{reason}"


def _document(pin: Pin) -> dict[str, object]:
    return {
        "name": pin.name,
        "digests": list(pin.digests),
        "scenes": list(pin.scenes),
        "reason": pin.reason,
        "created": pin.created,
        "process": None if pin.owner is None else {"host": pin.owner.host, "pid": pin.owner.pid},
        "expires_at": pin.expires_at,
    }
