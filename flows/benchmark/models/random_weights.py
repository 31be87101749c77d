"""Write random weights in a model's own format: what it costs depends on their size only."""

from __future__ import annotations

import importlib
import json
import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from flows.wrong_use import WrongUse
from tasks.model.settings import FILE, settings_file

SEED = 0


def _depth_anything_3(folder: Path, variant: str) -> None:
    import torch
    from safetensors.torch import save_file

    configuration = importlib.import_module("depth_anything_3.cfg")
    registry = importlib.import_module("depth_anything_3.registry").MODEL_REGISTRY
    if variant not in registry:
        raise WrongUse(f"Depth-Anything-3 has no {variant}: there are {', '.join(registry)}")
    torch.manual_seed(SEED)
    network = configuration.create_object(configuration.load_config(registry[variant]))
    state = {f"model.{name}": tensor.clone() for name, tensor in network.state_dict().items()}
    save_file(state, folder / "model.safetensors")
    (folder / "config.json").write_text(json.dumps({"model_name": variant}), "utf-8")


def _sam3(folder: Path, variant: str) -> None:
    import torch

    transformers: Any = importlib.import_module("transformers")
    torch.manual_seed(SEED)
    transformers.Sam3TrackerModel(transformers.Sam3TrackerConfig()).save_pretrained(folder)


Maker = Callable[[Path, str], None]
MAKERS: dict[str, tuple[Maker, str]] = {
    "depth_anything_3": (_depth_anything_3, "da3-small"),
    "sam3": (_sam3, ""),
}
"""By model: what writes its weights, and the variant if none is given."""


@contextmanager
def random_weights(names: Sequence[str], variant: str | None, folder: Path) -> Iterator[None]:
    """Have models find random weights in ``folder``; their other settings stay.

    Raises WrongUse for a model of which none can be made.
    """
    settings = []
    for name in names:
        if name not in MAKERS:
            raise WrongUse(
                f"random weights can be made of {' and '.join(MAKERS)}, not of {name}: put its"
                " weights in place (`garden doctor` says where)"
            )
        make, usual = MAKERS[name]
        (folder / name).mkdir(parents=True)
        make(folder / name, variant or usual)
        settings.append(_table(name, folder / name))
    file = folder / "models.toml"
    file.write_text("\n".join(settings), "utf-8")
    before = os.environ.get(FILE)
    os.environ[FILE] = str(file)
    try:
        yield
    finally:
        os.environ.pop(FILE)
        if before is not None:
            os.environ[FILE] = before


def _table(name: str, weights: Path) -> str:
    """Return a model's settings as they are, but for its weights."""
    file = settings_file()
    found = tomllib.loads(file.read_text("utf-8")).get(name, {}) if file.is_file() else {}
    found["weights"] = str(weights)
    options = [f"{option} = {json.dumps(value)}" for option, value in found.items()]
    return "\n".join([f"[{name}]", *options])
