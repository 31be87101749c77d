"""Extract a backbone's camera tokens of one data set's sequence. Minutes, GPU.

The tokens are cached by the weights and by the photos and poses that they come from, so that
training never runs the backbone.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from garden_models.gravity.training.token_shard import TokenShard
from garden_models.gravity.training.windows import Windows
from garden_models.progress import Progress, silent
from tasks.step import step


def _weights(backbone: str, dataset: str, root: str, **_others: object) -> dict[str, str | Path]:
    """Return the backbone's weights, and a digest of which files the data set holds."""
    files = sorted(p for p in Path(root).rglob("*") if p.is_file())
    listing = "\n".join(f"{p.relative_to(root)} {p.stat().st_size}" for p in files)
    data = hashlib.blake2b(f"{dataset}\n{listing}".encode()).hexdigest()
    return {"backbone": Path(backbone) / "model.safetensors", "data": data}


@step(
    version=1,
    packages=("torch", "numpy", "opencv-python-headless", "safetensors", "scipy"),
    weights=_weights,
    skip=("root", "backbone", "device"),
    isolated=True,
    here=True,
)
def extract_gravity_tokens(
    dataset: str,
    root: str,
    sequence: str,
    backbone: str,
    windows: Windows,
    device: str,
    progress: Progress = silent,
) -> TokenShard:
    """Return the tokens of scenes cut from a sequence, with the true Gravity-View."""
    from garden_models.gravity.training.extract import extract_tokens

    return extract_tokens(dataset, Path(root), sequence, Path(backbone), windows, device, progress)
