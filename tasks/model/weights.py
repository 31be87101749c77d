"""Find a model's weight files and identify them, without reading gigabytes each time.

What a step's key needs is their content. A file's digest is kept in the user's cache by
path, size, time of change and inode, and read from there while none of these changes.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from pathlib import Path

from garden_models import foundation
from garden_models.scene import BadInput
from storage.digest import digest_file
from storage.user_folders import cache_folder
from tasks.model.settings import model_settings
from tasks.model.variant import variant_of
from tasks.step.code import code_of

_FRESH_NS = 2_000_000_000
"""A file that changed this shortly ago may change again without a newer time of change."""

_CODE_DIGITS = 19


def weight_files(name: str) -> dict[str, Path]:
    """Return a model's weight files by their place in its folder.

    Raises BadInput that names the first missing file and where to put it.
    """
    card, folder = foundation.card(name), model_settings(name).weights
    found: dict[str, Path] = {}
    for weight in card.weights:
        path = folder / weight.path
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        if not files or not all(p.is_file() for p in files):
            note = f" ({weight.note})" if weight.note else ""
            raise BadInput(
                f"{name} needs its weights {weight.path}{note}: put them at {path}, or name"
                f" their folder as {name}.weights in the model settings"
            )
        found |= {p.relative_to(folder).as_posix(): p for p in files}
    return found


def weights_of(name: str) -> dict[str, str]:
    """Return what identifies a model: digests of its weight files and of its adapter's code.

    For ``weights=`` of a step that calls it: the code is not seen by the step's own digest.
    A precision other than float32 is among it too. Raises BadInput as ``weight_files`` does.
    """
    known = _read()
    digests = {place: _digest(path, known) for place, path in weight_files(name).items()}
    digests["adapter"] = code_of(foundation.ADAPTERS[name]).digest[:_CODE_DIGITS]
    dtype = model_settings(name).dtype
    return digests if dtype == "float32" else digests | {"dtype": dtype}


def backend_of(name: str) -> str:
    """Return a model's name, with its variant (``name/variant``) if its weights say it.

    For ``backend=`` of a step that calls it.
    """
    variant = variant_of(foundation.card(name), model_settings(name).weights)
    return name if variant is None else f"{name}/{variant}"


def stamp_of(name: str) -> str:
    """Return what changes when a model's weight files are replaced; no file is read."""
    return json.dumps([[place, *_status(p)] for place, p in weight_files(name).items()])


def _digest(path: Path, known: dict[str, list[object]]) -> str:
    place, status = str(path.resolve()), _status(path)
    kept = known.get(place)
    if kept is not None and kept[:-1] == status:
        return str(kept[-1])
    digest = digest_file(path)
    settled = time.time_ns() - path.stat().st_mtime_ns > _FRESH_NS
    if settled and _status(path) == status:
        known[place] = [*status, digest]
        _write(known)
    return digest


def _status(path: Path) -> list[object]:
    found = path.stat()
    return [found.st_size, found.st_mtime_ns, found.st_ino]


def _file() -> Path:
    return cache_folder() / "weight_digests.json"


def _read() -> dict[str, list[object]]:
    try:
        document = json.loads(_file().read_bytes())
    except (OSError, ValueError):
        return {}
    return document if isinstance(document, dict) else {}


def _write(known: dict[str, list[object]]) -> None:
    """Keep digests for the next time; that they cannot be kept costs time only."""
    file = _file()
    partial = file.with_name(f".{file.name}.{os.getpid()}")
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps(_read() | known))
        partial.replace(file)
