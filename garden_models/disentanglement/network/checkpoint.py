"""Write and read trained weights: safetensors with what is needed to trust them.

The metadata holds the format's version, the network's configuration, the sizes of its inputs,
the unit of length and what it was trained on. A checkpoint that does not fit is refused.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import blake3
import safetensors
import safetensors.torch
import torch

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import AROUND, OBJECT, OWN
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.scene import BadInput

VERSION = 1
"""Raise it when the meaning of an input or of a weight changes."""
UNIT = "metre"
_KEY = "garden"


@dataclass(frozen=True)
class Checkpoint:
    """A network with its record (plain JSON: data, training, metrics) and content digest."""

    model: PointClassifier
    record: dict[str, Any]
    digest: str


def to_bytes(model: PointClassifier, record: dict[str, Any]) -> bytes:
    """Return a checkpoint as safetensors."""
    description = {
        "kind": "point-classifier",
        "version": VERSION,
        "unit": UNIT,
        "inputs": {"own": OWN, "around": AROUND, "object": OBJECT},
        "network": dataclasses.asdict(model.config),
        "record": record,
    }
    weights = {name: w.detach().cpu().contiguous() for name, w in model.state_dict().items()}
    # One key: the order of several in the file is not defined.
    return safetensors.torch.save(weights, {_KEY: json.dumps(description, sort_keys=True)})


def load_checkpoint(path: Path, digest: str = "") -> Checkpoint:
    """Read a checkpoint; with ``digest`` (BLAKE3, hexadecimal), only if it is that one.

    Raises BadInput: no such file, another content, another version or unit, a network of
    another size, or weights that are not finite.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(f"point classifier {path}: {error.strerror}") from error
    if digest and digest_of(data) != digest:
        raise BadInput(
            f"point classifier {path} has the digest {digest_of(data)[:12]}, not the expected "
            f"{digest[:12]}: restore the file"
        )
    return from_bytes(data, str(path))


def from_bytes(data: bytes, name: str = "checkpoint") -> Checkpoint:
    """Read a checkpoint from its bytes; raises BadInput as ``load_checkpoint``."""
    description = _description(data, name)
    try:
        weights = safetensors.torch.load(data)
        model = PointClassifier(NetworkConfig(**description["network"]))
        model.load_state_dict(weights)
    except (TypeError, RuntimeError, safetensors.SafetensorError) as error:
        raise BadInput(f"point classifier {name}: its weights do not fit: {error}") from error
    bad = [key for key, weight in weights.items() if not torch.isfinite(weight).all()]
    if bad:
        raise BadInput(f"point classifier {name}: {bad[0]} holds values that are not finite")
    model.eval()
    return Checkpoint(model, description["record"], digest_of(data))


def digest_of(data: bytes) -> str:
    """Return the digest by which a checkpoint is named."""
    return str(blake3.blake3(data).hexdigest())


def _description(data: bytes, name: str) -> dict[str, Any]:
    try:
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])
        description: dict[str, Any] = json.loads(header["__metadata__"][_KEY])
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{name} is no checkpoint of a point classifier") from error
    expected = {
        "kind": "point-classifier",
        "version": VERSION,
        "unit": UNIT,
        "inputs": {"own": OWN, "around": AROUND, "object": OBJECT},
    }
    for key, wanted in expected.items():
        if description.get(key) != wanted:
            raise BadInput(
                f"point classifier {name}: {key} is {description.get(key)!r}, this program "
                f"needs {wanted!r}: train it again with `garden train point-classifier`"
            )
    return description
