"""Seed the global generators before a step, as a net below explicitly seeded code."""

from __future__ import annotations

import random
import sys


def seed_everything(seed: int, *, with_torch: bool) -> None:
    """Seed Python, numpy and (if loaded or ``with_torch``) torch."""
    import numpy as np

    random.seed(seed)
    np.random.seed(seed % 2**32)
    if with_torch or "torch" in sys.modules:
        import torch

        torch.manual_seed(seed)
