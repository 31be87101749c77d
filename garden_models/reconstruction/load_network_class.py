"""Build a network of a class that is installed apart, with the weights of a folder."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from garden_models.foundation.model_card import ModelCard
from garden_models.reconstruction.memory_need import WEIGHT_FILES
from garden_models.scene import BadInput


def read_weights(folder: Path) -> dict[str, torch.Tensor]:
    """Return the weights of a folder; raise BadInput if there are none or they are damaged."""
    for name in WEIGHT_FILES:
        path = folder / name
        if not path.is_file():
            continue
        try:
            if path.suffix == ".safetensors":
                from safetensors.torch import load_file

                return load_file(path)
            loaded: dict[str, torch.Tensor] = torch.load(
                path, map_location="cpu", weights_only=True
            )
            return loaded
        except Exception as error:
            raise BadInput(f"{path} cannot be read ({error}): download it again") from error
    raise BadInput(f"{folder} holds no weights: put {' or '.join(WEIGHT_FILES)} there")


def weight_names(folder: Path) -> set[str]:
    """Return the names of a folder's weights without reading them, where the file allows it."""
    path = folder / WEIGHT_FILES[0]
    if not path.is_file():
        return set(read_weights(folder))
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as opened:
            return set(opened.keys())
    except (OSError, SafetensorError) as error:
        raise BadInput(f"{path} cannot be read ({error}): download it again") from error


def load_network_class(
    module: str,
    name: str,
    folder: Path,
    card: ModelCard,
    options: Mapping[str, Any],
    leave_out: tuple[str, ...] = (),
) -> Any:
    """Return the network ``module.name(**config.json, **options)`` with its weights.

    Weights whose names begin with one of ``leave_out`` are not needed. Raises BadInput if the
    package is missing or of another version, or the weights do not fit.
    """
    weights = {k: w for k, w in read_weights(folder).items() if not k.startswith(leave_out)}
    try:
        network_class = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise BadInput(f"{card.title} is not installed: {card.install} ({error})") from error
    try:
        net = network_class(**(_config(folder) | dict(options)))
    except TypeError as error:
        raise BadInput(
            f"{folder}/config.json does not fit the installed {card.title} ({error}): take both "
            f"of the same version; {card.install}"
        ) from error
    try:
        net.load_state_dict(weights, strict=True)
    except RuntimeError as error:
        raise BadInput(f"{folder}: the weights do not fit {card.title}: {error}") from error
    return net.eval().requires_grad_(False)


def _config(folder: Path) -> dict[str, Any]:
    path = folder / "config.json"
    if not path.is_file():
        return {}
    try:
        config: dict[str, Any] = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(f"{path} is not JSON ({error})") from error
    return config
