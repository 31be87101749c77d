"""Write the page that shows every augmentation before and after."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from flows.training.pages import page, pictures, section
from flows.training.run import write_whole
from garden_models.disentanglement.training.augmentations.config import NAMES
from garden_models.disentanglement.training.config import training_preset

CROPS = 8


def write_gallery(path: Path, preset: str, crops: int = CROPS) -> None:
    """Write the page for a preset's augmentations, at full strength."""
    from garden_models.disentanglement.training.gallery import augmentation_gallery

    config = training_preset(preset).pairs.augmentations
    jitter = dataclasses.replace(config.mesh_jitter, gentle=0.0)
    config = dataclasses.replace(config, each=1.0, mesh_jitter=jitter)
    rows = augmentation_gallery(crops, config)
    settings = "".join(
        f"<li><b>{name.replace('_', ' ')}</b>: {_values(getattr(config, name))}</li>"
        for name in NAMES
    )
    lengths = "relative to the object's size" if config.relative else "in metres for every object"
    parts = [
        section(
            "What is done",
            f"<ul>{settings}</ul><p>The voxel is {config.voxel_m:g} m; lengths are {lengths}. "
            "Orange: the object's points; grey: the scene's; green: the mesh that is given.</p>",
        ),
        *(section(row.shape, pictures(row.pictures)) for row in rows),
    ]
    write_whole(path, page(f"Augmentations of the preset {preset}", parts).encode())


def _values(config: object) -> str:
    assert dataclasses.is_dataclass(config)
    values = {f.name: getattr(config, f.name) for f in dataclasses.fields(config)}
    return ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in values.items())
