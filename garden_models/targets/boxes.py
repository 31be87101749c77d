"""Read the boxes of the objects to factor out, and check them before any work starts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from garden_models.scene import BadInput, Target

FORM = '{"targets": [{"name": "mug", "image": "a.jpg", "box": [x0, y0, x1, y1]}]}'
_LONGEST_NAME_BYTES = 200
"""File systems take 255, and a package is staged under a longer name than its own."""

_SAFE_NAME = re.compile(r"[^\W.\-][\w.\- ]{0,99}")


def check_name(name: str, what: str) -> str:
    """Return ``name`` if it is safe as a folder's name, else raise BadInput.

    ``what`` says what is called so (``scene``, ``target``).
    """
    fits = len(name.encode(errors="replace")) <= _LONGEST_NAME_BYTES
    if not (fits and _SAFE_NAME.fullmatch(name)) or name.endswith((".", " ")):
        raise BadInput(
            f"{name!r} cannot be the name of a {what}: use letters, digits, spaces, '_', '-' and "
            "'.', starting with a letter or digit, 100 at most"
        )
    return name


def parse_targets(document: object) -> tuple[Target, ...]:
    """Return the targets of a ``targets.json`` document; BadInput if it has another form."""
    entries = document.get("targets") if isinstance(document, dict) else None
    if not isinstance(entries, list):
        raise BadInput(f"the targets must have the form {FORM}")
    return tuple(_target(entry) for entry in entries)


def parse_boxes(values: Sequence[Sequence[str]]) -> tuple[Target, ...]:
    """Return the targets of ``--box NAME PHOTO X0 Y0 X1 Y1`` values."""
    return tuple(
        _target({"name": value[0], "image": value[1], "box": list(value[2:])}) for value in values
    )


def validate(targets: Sequence[Target], sizes: Mapping[str, tuple[int, int]]) -> None:
    """Raise BadInput for the first target that cannot be.

    ``sizes`` are the photos' (width, height) in pixels of the files, upright.
    """
    seen: set[str] = set()
    for target in targets:
        check_name(target.name, "target")
        if target.name in seen:
            raise BadInput(f"two targets are called {target.name}: give each a name of its own")
        seen.add(target.name)
        if target.photo not in sizes:
            raise BadInput(
                f"target {target.name} names the photo {target.photo}, which is not in "
                f"the capture: use one of its photos, such as {next(iter(sizes), 'none')}"
            )
        _check_box(target, sizes[target.photo])


def _check_box(target: Target, size: tuple[int, int]) -> None:
    x0, y0, x1, y1 = target.box
    box = f"the box {[float(f'{v:g}') for v in target.box]} of target {target.name}"
    if not (x0 < x1 and y0 < y1):
        raise BadInput(f"{box} has no area: give its left, top, right and bottom in pixels")
    # Half a pixel of tolerance: tools differ in whether the last pixel counts.
    if x0 < -0.5 or y0 < -0.5 or x1 > size[0] + 0.5 or y1 > size[1] + 0.5:
        raise BadInput(
            f"{box} lies outside its photo {target.photo} ({size[0]} x {size[1]} pixels): give "
            "pixels of that file"
        )


def _target(entry: Any) -> Target:
    try:
        name, photo, box = str(entry["name"]), str(entry["image"]), entry["box"]
        x0, y0, x1, y1 = (float(value) for value in box)
    except (TypeError, KeyError, ValueError):
        raise BadInput(f"the target {entry!r} is not of the form {FORM}") from None
    if not np.isfinite([x0, y0, x1, y1]).all():
        raise BadInput(f"the box of target {name} must be four finite numbers, got {box}")
    return Target(name, photo, (x0, y0, x1, y1))
