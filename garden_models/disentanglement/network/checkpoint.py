"""Write and read trained weights: safetensors with what is needed to trust them.

The metadata holds the format's version, the network's configuration, the sizes of its inputs,
the unit of length and what it was trained on. A checkpoint that does not fit is refused.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors

from garden_models.disentanglement.network.config import NetworkConfig
from garden_models.disentanglement.network.describe import AROUND, OBJECT, OWN
from garden_models.disentanglement.network.model import PointClassifier
from garden_models.scene import BadInput
from garden_models.training.weights_file import (
    pack_weights,
    read_description,
    read_weights_file,
    unpack_weights,
    weights_digest,
)

VERSION = 1
"""Raise it when the meaning of an input or of a weight changes."""
UNIT = "metre"
WHAT = "point classifier"


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
    return pack_weights(model, description)


def load_checkpoint(path: Path, digest: str = "") -> Checkpoint:
    """Read a checkpoint; with ``digest`` (BLAKE3, hexadecimal), only if it is that one.

    Raises BadInput: no such file, another content, another version or unit, a network of
    another size, or weights that are not finite.
    """
    return from_bytes(read_weights_file(path, digest, WHAT), str(path))


def from_bytes(data: bytes, name: str = "checkpoint") -> Checkpoint:
    """Read a checkpoint from its bytes; raises BadInput as ``load_checkpoint``."""
    expected = {
        "kind": "point-classifier",
        "version": VERSION,
        "unit": UNIT,
        "inputs": {"own": OWN, "around": AROUND, "object": OBJECT},
    }
    train = "garden train point-classifier"
    description = read_description(data, expected, what=WHAT, name=name, train=train)
    try:
        model = PointClassifier(NetworkConfig(**description["network"]))
        unpack_weights(data, model, what=WHAT, name=name)
    except (TypeError, RuntimeError, safetensors.SafetensorError) as error:
        raise BadInput(f"{WHAT} {name}: its weights do not fit: {error}") from error
    model.eval()
    return Checkpoint(model, description["record"], weights_digest(data))
