"""Find what holds results against collection: pins, and leases of work in progress."""

from __future__ import annotations

from storage import actions
from storage.keep import Held
from storage.leases import leased_key
from storage.medium import Medium
from storage.pins import all_pins


def held(medium: Medium) -> Held:
    """Return all that must not be forgotten now.

    Raises:
        StoreError: a pin cannot be read, so that what it holds is not known.
    """
    digests: set[str] = set()
    scenes: set[str] = set()
    for pin in all_pins(medium):
        digests.update(pin.digests)
        scenes.update(pin.scenes)
    for scene in scenes:  # a scene also stands on results that were made for another one
        digests.update(key for _step, _label, key in actions.latest_of_scene(medium, scene))
    for name in medium.names("leases/"):
        key = leased_key(name)
        if key is not None and medium.leases.holder(key) is not None:
            digests.add(key)
    return Held(frozenset(digests), frozenset(scenes))
