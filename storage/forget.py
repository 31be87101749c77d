"""Forget results in the order that leaves no action without its object.

Actions go first, and for good, before anything happens to an object. What was known of them
stays where only explanations look (``latest/``), as far as there is room for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

from storage import actions
from storage.actions import ActionRecord
from storage.medium import Medium


def forget(medium: Medium, records: Iterable[ActionRecord]) -> None:
    """Forget actions; their objects are not touched."""
    names: list[str] = []
    for record in records:
        with suppress(OSError):  # explanations are worth less than room
            actions.keep_for_explanations(medium, record)
        names += [actions.action_name(record.key), use_name(record.key)]
    medium.delete(*names)


def quarantine(medium: Medium, digest: str) -> bool:
    """Move a damaged object away for autopsy, after every action that gave it is forgotten.

    False if it was gone already.
    """
    forget(medium, users(medium, digest))
    return medium.quarantine(digest)


def users(medium: Medium, digest: str) -> list[ActionRecord]:
    """Return the actions that gave an object."""
    return [
        record
        for record in actions.all_actions(medium)
        if any(output.object == digest for output in record.outputs.values())
    ]


def use_name(key: str) -> str:
    """Return the name of the document whose age is the time since a key's last hit."""
    return actions.action_name(key).replace("actions/", "uses/", 1).removesuffix(".json")
