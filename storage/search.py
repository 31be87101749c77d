"""Find actions by what a user types."""

from __future__ import annotations

from storage.actions import ActionRecord

SHORTEST_DIGEST = 6  # digits; fewer could mean many artifacts


def matches(record: ActionRecord, text: str) -> bool:
    """Tell whether ``text`` names an action.

    It is a step, a step with its label (``segment[bulldozer]``), a scene and a step
    (``kitchen/segment``), or the start of a key, object or content digest.
    """
    named = f"{record.step}[{record.label}]" if record.label else record.step
    if text in (record.step, named, f"{record.scene}/{record.step}", f"{record.scene}/{named}"):
        return True
    bare = text.removeprefix("b3:")
    if len(bare) < SHORTEST_DIGEST:
        return False
    digests = [record.key]
    for output in record.outputs.values():
        digests += [output.object, output.content]
    return any(digest.removeprefix("b3:").startswith(bare) for digest in digests)
