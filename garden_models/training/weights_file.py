"""Write and read a network's weights: safetensors with a description of what they are for.

A file that does not fit, in kind, version, unit, size or content, is refused; ``what`` is how
messages call the network.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import blake3
import safetensors
import safetensors.torch
import torch
from torch import nn

from garden_models.scene import BadInput

_KEY = "garden"


def pack_weights(model: nn.Module, description: Mapping[str, Any]) -> bytes:
    """Return the weights as safetensors, with the description (plain JSON) as metadata."""
    weights = {name: w.detach().cpu().contiguous() for name, w in model.state_dict().items()}
    # One key: the order of several in the file is not defined.
    return safetensors.torch.save(weights, {_KEY: json.dumps(description, sort_keys=True)})


def weights_digest(data: bytes) -> str:
    """Return the digest (BLAKE3, hexadecimal) by which a file of weights is named."""
    return str(blake3.blake3(data).hexdigest())


def read_weights_file(path: Path, digest: str, what: str) -> bytes:
    """Return a file's bytes; with ``digest`` only if they are these. Raises BadInput."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(f"{what} {path}: {error.strerror}") from error
    if digest and weights_digest(data) != digest:
        raise BadInput(
            f"{what} {path} has the digest {weights_digest(data)[:12]}, not the expected "
            f"{digest[:12]}: restore the file"
        )
    return data


def read_description(
    data: bytes, expected: Mapping[str, Any], *, what: str, name: str, train: str
) -> dict[str, Any]:
    """Return the description; BadInput if it lacks one of the ``expected`` values.

    ``train`` is the command that makes weights that fit.
    """
    try:
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])
        description: dict[str, Any] = json.loads(header["__metadata__"][_KEY])
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{name} is no checkpoint of a {what}") from error
    for key, wanted in expected.items():
        if description.get(key) != wanted:
            raise BadInput(
                f"{what} {name}: {key} is {description.get(key)!r}, this program "
                f"needs {wanted!r}: train it again with `{train}`"
            )
    return description


def unpack_weights(data: bytes, model: nn.Module, *, what: str, name: str) -> None:
    """Put the weights into ``model``; BadInput if one of them is not finite.

    Raises RuntimeError or SafetensorError for weights of another network.
    """
    weights = safetensors.torch.load(data)
    model.load_state_dict(weights)
    bad = [key for key, weight in weights.items() if not torch.isfinite(weight).all()]
    if bad:
        raise BadInput(f"{what} {name}: {bad[0]} holds values that are not finite")
