"""Run a network in half precision where the device has it."""

from __future__ import annotations

from contextlib import AbstractContextManager

import torch


def half_precision(device: torch.device) -> AbstractContextManager[object]:
    """Return a context: bfloat16 on a GPU that knows it, else float16; full precision on CPU."""
    if device.type != "cuda":
        return torch.autocast(device.type, enabled=False)
    known = torch.cuda.is_bf16_supported()
    return torch.autocast("cuda", dtype=torch.bfloat16 if known else torch.float16)
