"""Raise here what was raised in a model's worker."""

from __future__ import annotations

from typing import Any

from garden_models import scene
from garden_models.foundation import failure
from storage.redact import redact

_OURS: dict[str, type[Exception]] = {
    "BadInput": scene.BadInput,
    "BadGeometry": scene.BadGeometry,
    "ModelOutOfMemory": failure.ModelOutOfMemory,
    "ModelFailed": failure.ModelFailed,
}


def raised_in_worker(name: str, error: dict[str, Any]) -> Exception:
    """Return an error of a worker as the one that it was, ModelFailed if its kind is foreign.

    A foreign error's traceback is among its notes.
    """
    kind, message = str(error["kind"]), redact(str(error["message"]))
    if kind in _OURS:
        return _OURS[kind](message)
    if kind == "BadPayload":
        return failure.ModelFailed(f"{name}: {message}")
    if kind in ("ModuleNotFoundError", "ImportError"):
        return scene.BadInput(f"{name} cannot be loaded in its environment: {message}")
    failed = failure.ModelFailed(f"{name} raised {kind}: {message}")
    failed.add_note(redact(str(error.get("traceback", ""))))
    return failed


def to_json(error: Exception) -> dict[str, Any]:
    """Return an error as a worker would tell it."""
    notes = "\n".join(getattr(error, "__notes__", ()))
    return {"kind": type(error).__name__, "message": str(error), "traceback": notes}
