"""Make optimisation steps whose result does not depend on where a training was cut.

What a step sees follows from its number and the seed alone, so a training that is killed and
taken up again ends with the same weights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from garden_models.progress import Progress, silent
from garden_models.training.packing import pack, unpack
from garden_models.training.schedule import Schedule, rate_at
from garden_models.training.state import TrainingState

LARGEST_GRADIENT = 1.0


def start_training(make: Callable[[], nn.Module], config: Schedule) -> TrainingState:
    """Return a training before its first step: weights by the seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        model = make()
    return pack(0, model, _optimiser(model, config), np.zeros(0))


def continue_training(
    state: TrainingState,
    model: nn.Module,
    loss_at: Callable[[int], Tensor],
    config: Schedule,
    steps: int,
    progress: Progress = silent,
) -> TrainingState:
    """Return the training ``steps`` steps later (at most to its end).

    ``loss_at`` gives the loss of ``model`` (on ``config.device``) at a step's number.
    """
    with _deterministic(config.threads):
        optimiser = _optimiser(model, config)
        unpack(state, model, optimiser)
        model.train()
        losses = []
        end = min(state.step + steps, config.steps)
        for step in range(state.step, end):
            rate = rate_at(step, config)
            for group in optimiser.param_groups:
                group["lr"] = config.learning_rate * rate
            loss = loss_at(step)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(model.parameters(), LARGEST_GRADIENT)
            optimiser.step()
            losses.append(float(loss.detach()))
            progress((step + 1) / config.steps, f"step {step + 1}, loss {losses[-1]:.4f}")
        return pack(end, model, optimiser, np.concatenate([state.losses, losses]))


def _optimiser(model: nn.Module, config: Schedule) -> torch.optim.AdamW:
    return torch.optim.AdamW(
        model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )


@contextmanager
def _deterministic(threads: int) -> Iterator[None]:
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    memory: Any = torch.utils.deterministic
    filled = memory.fill_uninitialized_memory
    torch.set_num_threads(threads)
    torch.use_deterministic_algorithms(True)
    # No kernel here reads memory that none wrote: filling it costs a tenth of a step.
    memory.fill_uninitialized_memory = False
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        torch.use_deterministic_algorithms(before[1])
        memory.fill_uninitialized_memory = filled
