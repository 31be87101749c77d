"""Write and read a trained decoder: safetensors with what is needed to trust it.

The metadata holds the format's version, which tokens it reads and their size, the network's
configuration, the calibration of its claims, what its tokens looked like, and what it was
trained on. A checkpoint that does not fit is refused.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors

from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.familiarity import Familiarity
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.uncertainty import Calibration
from garden_models.scene import BadInput
from garden_models.training.weights_file import (
    pack_weights,
    read_description,
    read_weights_file,
    unpack_weights,
    weights_digest,
)

VERSION = 1
"""Raise it when the meaning of an output or of a weight changes."""
ANGLE_UNIT = "radian"
KIND = "gravity-view-decoder"
WHAT = "gravity decoder"


@dataclass(frozen=True)
class Checkpoint:
    """A decoder with its calibration, what is familiar to it, its record and content digest.

    ``calibration`` and ``familiarity`` are None where they were not learned (networks that do
    not say how sure they are).
    """

    model: GravityViewDecoder
    calibration: Calibration | None
    familiarity: Familiarity | None
    record: dict[str, Any]
    digest: str


def to_bytes(
    model: GravityViewDecoder,
    calibration: Calibration | None,
    familiarity: Familiarity | None,
    record: dict[str, Any],
) -> bytes:
    """Return a checkpoint as safetensors."""
    config = model.config
    description = {
        "kind": KIND,
        "version": VERSION,
        "unit": ANGLE_UNIT,
        "tokens": {"kind": config.tokens, "width": config.token_width},
        "network": dataclasses.asdict(config),
        "calibration": None if calibration is None else dataclasses.asdict(calibration),
        "familiarity": None if familiarity is None else dataclasses.asdict(familiarity),
        "record": record,
    }
    return pack_weights(model, description)


def load_checkpoint(path: Path, tokens: str, width: int, digest: str = "") -> Checkpoint:
    """Read a checkpoint for tokens of a kind and width; with ``digest`` only if it is that one.

    Raises BadInput: no such file, another content, version or unit, other tokens, a network of
    another size, or weights that are not finite.
    """
    return from_bytes(read_weights_file(path, digest, WHAT), tokens, width, str(path))


def from_bytes(data: bytes, tokens: str, width: int, name: str = "checkpoint") -> Checkpoint:
    """Read a checkpoint from its bytes; raises BadInput as ``load_checkpoint``."""
    expected = {
        "kind": KIND,
        "version": VERSION,
        "unit": ANGLE_UNIT,
        "tokens": {"kind": tokens, "width": width},
    }
    train = "garden train gravity"
    description = read_description(data, expected, what=WHAT, name=name, train=train)
    try:
        model = GravityViewDecoder(DecoderConfig(**description["network"]))
        unpack_weights(data, model, what=WHAT, name=name)
        calibration = _known(Calibration, description["calibration"])
        familiarity = _known(Familiarity, description["familiarity"])
    except (TypeError, KeyError, RuntimeError, safetensors.SafetensorError) as error:
        raise BadInput(f"{WHAT} {name}: its weights do not fit: {error}") from error
    if model.config.token_width != width or model.config.tokens != tokens:
        raise BadInput(f"{WHAT} {name}: its network reads other tokens than it states")
    return Checkpoint(
        model.eval(), calibration, familiarity, description["record"], weights_digest(data)
    )


def check_tokens(checkpoint: Checkpoint, tokens: np.ndarray) -> None:
    """Raise BadInput for tokens of another size or with values that are not finite."""
    width = checkpoint.model.config.token_width
    if tokens.ndim != 2 or tokens.shape[1] != width:
        raise BadInput(
            f"the decoder reads tokens (views, {width}) of {checkpoint.model.config.tokens}; these "
            f"are {tokens.shape}: use the decoder that was trained on them"
        )
    if not np.isfinite(tokens).all():
        rows = np.flatnonzero(~np.isfinite(tokens).all(axis=1))
        raise BadInput(f"the token of view {rows[0]} has values that are not finite")


def _known(kind: Any, values: dict[str, Any] | None) -> Any:
    if values is None:
        return None
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
