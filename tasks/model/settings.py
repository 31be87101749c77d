"""Say how this machine runs each model: where its weights lie, on which device, in which
environment, within which limits.

They are read from a TOML file, ``$GARDEN_MODELS`` or ``garden/models.toml`` among the user's
settings, with one table a model (docs/model_workers.md). Of them only ``dtype`` changes
results, and only it is part of a step's key.
"""

from __future__ import annotations

import os
import tomllib
import typing
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal

from garden_models import foundation
from garden_models.scene import BadInput
from storage.user_folders import cache_folder, config_folder
from tasks.step.machine import usable_gpus

Dtype = Literal["float32", "bfloat16"]
FILE, WEIGHTS = "GARDEN_MODELS", "GARDEN_WEIGHTS"


@dataclass(frozen=True)
class ModelSettings:
    """How one model is run here.

    ``weights`` is the folder that holds its files. ``device`` is ``cpu``, ``cuda``, ``cuda:N``
    or ``auto``: a GPU if there is one. With ``python``, the interpreter of another environment
    or the words that start one, it runs in a worker process there. A worker's call, loading
    included, that takes longer than ``time_limit_s`` is stopped; so is one whose process holds
    more than ``memory_limit_gb``.
    """

    weights: Path
    device: str = "auto"
    python: tuple[str, ...] | None = None
    time_limit_s: float = 1800.0
    memory_limit_gb: float | None = None
    dtype: Dtype = "float32"


def settings_file() -> Path:
    """Return where the settings are looked for."""
    given = os.environ.get(FILE)
    return Path(given).expanduser() if given else config_folder() / "models.toml"


def default_weights(name: str) -> Path:
    """Return where a model's weights lie if the settings do not say."""
    given = os.environ.get(WEIGHTS)
    return (Path(given).expanduser() if given else cache_folder() / "weights") / name


def model_settings(name: str) -> ModelSettings:
    """Return a model's settings.

    Raises BadInput for an unknown model, or settings that cannot be read.
    """
    card = foundation.card(name)
    table = _tables().get(name, {})
    file = settings_file()
    values = {option: _typed(option, value, name, file) for option, value in table.items()}
    settings = ModelSettings(**{"weights": default_weights(name)} | values)
    kind = settings.device.partition(":")[0]
    if kind not in ("auto", *card.devices):
        allowed = " or ".join(card.devices)
        raise BadInput(f"{file}: {name} runs on {allowed}, not on {settings.device!r}")
    if settings.dtype != "float32" and not card.bfloat16:
        raise BadInput(f"{file}: {name} runs in float32 only")
    return settings


def device_of(name: str, settings: ModelSettings) -> str:
    """Return the device that ``auto`` means here; BadInput if the model needs one we lack."""
    devices = foundation.card(name).devices
    gpus = usable_gpus()
    if settings.device.startswith("cuda") and not gpus:
        raise BadInput(f"{name} is set to run on {settings.device}, and this machine has no GPU")
    if settings.device != "auto":
        return settings.device
    if gpus and "cuda" in devices and (settings.python or _torch_has_gpus()):
        return "cuda"
    if "cpu" not in devices:
        raise BadInput(f"{name} needs a GPU, and GARDEN finds none here: choose another method")
    return "cpu"


def _torch_has_gpus() -> bool:
    import torch

    return bool(torch.cuda.is_available())


def _tables() -> dict[str, dict[str, Any]]:
    file = settings_file()
    try:
        document = tomllib.loads(file.read_text("utf-8"))
    except FileNotFoundError:
        if os.environ.get(FILE):
            raise BadInput(f"no such file of model settings: {file} (${FILE})") from None
        return {}
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, OSError) as error:
        raise BadInput(f"{file} cannot be read as TOML: {error}") from None
    for name, table in document.items():
        if name not in foundation.ADAPTERS:
            known = ", ".join(foundation.ADAPTERS)
            raise BadInput(f"{file}: no model is called {name!r}; there are {known}")
        if not isinstance(table, dict):
            raise BadInput(f"{file}: {name} is a model; write its options below [{name}]")
    return document


def _typed(option: str, value: Any, name: str, file: Path) -> Any:
    """Return an option's value, checked; paths are relative to the file of settings."""
    where = f"{file}: {name}.{option}"
    known = [f.name for f in fields(ModelSettings)]
    if option not in known:
        raise BadInput(f"{where} is no option; there are {', '.join(known)}")
    if option == "weights":
        if not isinstance(value, str) or not value:
            raise BadInput(f"{where} must be a path")
        return file.parent / Path(value).expanduser()
    if option == "python":
        return _command(value, where, file)
    if option in ("time_limit_s", "memory_limit_gb"):
        if isinstance(value, bool) or not isinstance(value, int | float) or value <= 0:
            raise BadInput(f"{where} must be a positive number")
        return float(value)
    if option == "dtype" and value not in typing.get_args(Dtype):
        raise BadInput(f"{where} must be one of {', '.join(typing.get_args(Dtype))}")
    if not isinstance(value, str):
        raise BadInput(f"{where} must be a text")
    return value


def _command(value: Any, where: str, file: Path) -> tuple[str, ...]:
    """Return the words that start an interpreter; a name without a slash is looked for."""
    if isinstance(value, str) and value:
        return (str(file.parent / Path(value).expanduser()) if "/" in value else value,)
    if isinstance(value, list) and value and all(isinstance(word, str) for word in value):
        return tuple(value)
    raise BadInput(f"{where} must be the path of a Python, or a list of words that start one")
