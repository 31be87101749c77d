"""Read rooms of InternScenes' Real2Sim layout, for who has the data.

``Layout_info/<source>/<scan>/layout.json`` lists objects (``id``, ``category``, ``model_uid``,
``bbox`` of nine: centre, size, angles about z, x and y of the rotating frame; metres, z up)
beside ``StructureMesh/*.glb``; ``asset_library/<model_uid>.glb`` (or a folder with
``whole.glb``) holds the meshes. An asset is centred, turned to the canonical frame of its
source, scaled to its box axis by axis (clothes: by the least factor), turned and moved.

The data are under CC BY-NC-SA 4.0: what is trained on them is for non-commercial use.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from garden_models.disentanglement.training.scenes.room import Instance, Room, Structure
from garden_models.disentanglement.training.shapes.shape import LONGEST_EDGE, Shape, subdivided
from garden_models.scene import BadInput

LICENCE = "CC BY-NC-SA 4.0"
UNSUITED = frozenset({"window", "curtain", "mirror", "clothes", "clothing", "towel"})
"""Categories that are no rigid objects (supplement): they stay as structure."""
FLATTENED = frozenset({"carpet"})
TURNED = frozenset({"pen", "remote", "phone"})
"""PartNet categories whose long side points up in their files."""
SOURCES = (
    "partnet_mobility",
    "objaverse",
    "3D-FUTURE-model",
    "hssd-models",
    "gen_assets",
    "gr100",
)
UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""Room (y down) from layout (z up)."""
FLAT_FACTOR = 100.0
"""Carpets' assets are this many times too high."""


@dataclass(frozen=True)
class Item:
    """One object of a layout: its box's centre and size, and its angles (z, x, y), radians."""

    name: str
    category: str
    model: str
    centre: Float[np.ndarray, "3"]
    size: Float[np.ndarray, "3"]
    angles: Float[np.ndarray, "3"]


def read_room(layout: Path, assets: Path, turns: Mapping[str, float] | None = None) -> Room:
    """Return a layout as a room; ``turns`` are angles (degrees about z) by asset.

    Objects without an asset, or of a category that is no rigid object, are structure or
    left out. Raises BadInput if the layout or an asset cannot be read.
    """
    turns = turns or {}
    instances, structure = [], []
    for item in read_layout(layout):
        if not item.model:
            continue
        vertices, faces = _placed(item, assets, turns.get(item.model, 0.0))
        if item.category.lower() in UNSUITED or item.category.lower() in FLATTENED:
            structure.append(Structure(item.name, vertices, faces))
            continue
        base = float(vertices[:, 1].max())
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        origin = np.array([middle[0], base, middle[2]])
        shape = Shape(item.model, item.category, vertices - origin, faces)
        x, y, z = (float(v) for v in origin)
        instances.append(Instance(shape, (x, y, z), 0.0))
    for path in sorted((layout.parent / "StructureMesh").glob("*.glb")):
        vertices, faces = _mesh(path)
        # Structure meshes are saved with y up.
        structure.append(Structure(path.stem, vertices * np.array([1.0, -1.0, -1.0]), faces))
    return Room(layout.parent.name, tuple(instances), tuple(structure))


def read_layout(path: Path) -> tuple[Item, ...]:
    """Return the objects of a ``layout.json``. Raises BadInput, naming what is wrong."""
    try:
        entries = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise BadInput(f"{path} cannot be read as a layout: {error}") from error
    return tuple(_item(entry, f"{path}, object {k}") for k, entry in enumerate(entries))


def _item(entry: Mapping[str, Any], where: str) -> Item:
    try:
        box = np.asarray(entry["bbox"], float)
        name, category, model = (str(entry[key]) for key in ("id", "category", "model_uid"))
    except (KeyError, TypeError, ValueError) as error:
        raise BadInput(f"{where}: needs id, category, model_uid and bbox ({error})") from error
    if box.shape != (9,) or not np.isfinite(box).all() or (box[3:6] <= 0).any():
        raise BadInput(f"{where}: bbox must be nine finite numbers with positive sizes")
    return Item(name, category, model, box[:3], box[3:6], box[6:])


def canonical_turn(model: str, category: str, angle_deg: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation to the canonical frame (front +x, up +z) by the asset's source."""
    raised = _turn(0, 90)
    if model.startswith("partnet_mobility"):
        turn = _turn(2, 180) @ raised
        return _turn(1, 90) @ _turn(2, 180) @ turn if category.lower() in TURNED else turn
    if not model.startswith(SOURCES):
        raise BadInput(f"the asset {model} is of no known source: {', '.join(SOURCES)}")
    return _turn(2, angle_deg) @ _turn(2, 90) @ raised


def _placed(item: Item, assets: Path, angle_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return an item's mesh in the room, y down."""
    candidates = [assets / f"{item.model}.glb", assets / item.model / "whole.glb"]
    path = next((p for p in candidates if p.is_file()), None)
    if path is None:
        raise BadInput(f"the asset {item.model} is neither {candidates[0]} nor {candidates[1]}")
    vertices, faces = _mesh(path)
    vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    vertices = vertices @ canonical_turn(item.model, item.category, angle_deg).T
    extent = np.maximum(np.ptp(vertices, axis=0), 1e-6)
    factor = item.size / extent
    if item.category.lower() in ("clothes", "clothing"):
        factor = np.full(3, factor.min())
    if item.category.lower() in FLATTENED:
        factor[2] /= FLAT_FACTOR
    about_z, about_x, about_y = np.degrees(item.angles)
    rotation = _turn(2, about_z) @ _turn(0, about_x) @ _turn(1, about_y)
    placed = (vertices * factor) @ rotation.T + item.centre
    return placed @ UP.T, faces


def _mesh(path: Path) -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    try:
        mesh = trimesh.load(path, force="mesh")
    except (ValueError, OSError) as error:
        raise BadInput(f"{path} cannot be read as a mesh: {error}") from error
    return subdivided(np.asarray(mesh.vertices, float), np.asarray(mesh.faces), LONGEST_EDGE)


def _turn(axis: int, degrees: float) -> Float[np.ndarray, "3 3"]:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = c
    rotation[first, second], rotation[second, first] = -s, s
    return rotation
