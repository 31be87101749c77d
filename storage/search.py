"""Find actions by what a user types."""

from __future__ import annotations

SHORTEST_DIGEST = 6  # digits; fewer could mean many artifacts


def matches(text: str, key: str, scene: str, step: str, label: str, *digests: str) -> bool:
    """Tell whether ``text`` names an action with this key and these object and content digests.

    It is a step, a step with its label (``segment[bulldozer]``), a scene and a step
    (``kitchen/segment``), or the start of a key, object or content digest.
    """
    named = f"{step}[{label}]" if label else step
    if text in (step, named, f"{scene}/{step}", f"{scene}/{named}"):
        return True
    bare = text.removeprefix("b3:")
    if len(bare) < SHORTEST_DIGEST:
        return False
    return any(digest.removeprefix("b3:").startswith(bare) for digest in (key, *digests))
