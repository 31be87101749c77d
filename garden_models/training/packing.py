"""Pack a network and its AdamW moments into a training state, and take them up again."""

from __future__ import annotations

import numpy as np
import safetensors.torch
import torch
from torch import nn

from garden_models.training.state import TrainingState

_MOMENTS = ("exp_avg", "exp_avg_sq", "step")


def pack(
    step: int, model: nn.Module, optimiser: torch.optim.AdamW, losses: np.ndarray
) -> TrainingState:
    """Return the state of a training after ``step`` steps; its tensors are on the CPU."""
    tensors = {f"model.{name}": t for name, t in model.state_dict().items()}
    for name, parameter in model.named_parameters():
        for moment in _MOMENTS:
            if moment in optimiser.state[parameter]:
                tensors[f"{moment}.{name}"] = optimiser.state[parameter][moment]
    packed = {name: t.detach().cpu().contiguous() for name, t in tensors.items()}
    return TrainingState(step, safetensors.torch.save(packed), np.asarray(losses, np.float64))


def unpack(state: TrainingState, model: nn.Module, optimiser: torch.optim.AdamW) -> None:
    """Put a state's weights into ``model`` and its moments into ``optimiser``."""
    tensors = safetensors.torch.load(state.tensors)
    model.load_state_dict({name: tensors[f"model.{name}"] for name in model.state_dict()})
    for name, parameter in model.named_parameters():
        if f"step.{name}" in tensors:
            optimiser.state[parameter] = {
                moment: tensors[f"{moment}.{name}"].to(
                    parameter.device if moment != "step" else "cpu"
                )
                for moment in _MOMENTS
            }


def load_weights(state: TrainingState, model: nn.Module) -> None:
    """Put a state's weights into ``model`` and set it to inference."""
    tensors = safetensors.torch.load(state.tensors)
    model.load_state_dict(
        {k.removeprefix("model."): t for k, t in tensors.items() if k.startswith("model.")}
    )
    model.eval()
