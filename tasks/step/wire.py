"""Write the arguments and events of a step as JSON, and read them in another process."""

from __future__ import annotations

import base64
import dataclasses
from typing import Any

from storage.canonical import dtype_name, is_array, little_endian
from storage.codec.tree import decode, encode
from tasks.step.ref import Ref, Seconds, StepEvent, Why

Json = Any


def plain_to_json(value: object) -> Json:
    """Return a plain argument (config, target, scalar, small arrays) as JSON."""
    encoded = encode(value)
    leaves = {path: _leaf_to_json(leaf) for path, leaf in encoded.leaves.items()}
    return {"tree": encoded.tree, "leaves": leaves}


def plain_from_json(document: Json, hint: object) -> Any:
    """Return what ``plain_to_json`` was given, built by the parameter's type hint."""
    leaves = document["leaves"]
    return decode(document["tree"], hint, lambda path: _leaf_from_json(leaves[path]))


def refs_to_json(value: Any) -> Json:
    """Return a Ref, None, or a tuple of these as JSON."""
    if isinstance(value, Ref):
        return {"ref": value.to_json()}
    if isinstance(value, tuple):
        return [refs_to_json(item) for item in value]
    if value is None:
        return None
    raise TypeError(f"a tuple of references holds a {type(value).__name__}")


def refs_from_json(document: Json) -> Any:
    """Return what ``refs_to_json`` was given."""
    if isinstance(document, list):
        return tuple(refs_from_json(item) for item in document)
    return None if document is None else Ref.from_json(document["ref"])


def event_to_json(event: StepEvent) -> Json:
    """Return an event as JSON."""
    return dataclasses.asdict(event)


def event_from_json(document: Json) -> StepEvent:
    """Return what ``event_to_json`` was given."""
    values = dict(document)
    values["reasons"] = tuple(values["reasons"])
    values["seconds"] = Seconds(**values["seconds"])
    values["why"] = None if values["why"] is None else Why(**values["why"])
    values["ref"] = None if values["ref"] is None else Ref.from_json(values["ref"])
    return StepEvent(**values)


def _leaf_to_json(leaf: Any) -> Json:
    if isinstance(leaf, str):
        return {"text": leaf}
    if isinstance(leaf, bytes):
        return {"bytes": base64.b64encode(leaf).decode()}
    if is_array(leaf):
        data = base64.b64encode(little_endian(leaf).tobytes()).decode()
        return {"dtype": dtype_name(leaf), "shape": list(leaf.shape), "data": data}
    raise TypeError(f"a {type(leaf).__name__} cannot be given to an isolated step as plain value")


def _leaf_from_json(document: Json) -> Any:
    if "text" in document:
        return document["text"]
    if "bytes" in document:
        return base64.b64decode(document["bytes"])
    import numpy as np

    data = np.frombuffer(base64.b64decode(document["data"]), dtype=document["dtype"])
    return data.reshape(document["shape"]).copy()
