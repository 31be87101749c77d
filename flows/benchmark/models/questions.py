"""Make up what models are asked: photos of a textured room, boxes, depth, a mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from garden_models.meshing.mesh_model import MeshRequest
from garden_models.placement.pose_model import PoseRequest
from garden_models.reconstruction.geometry_model import GeometryRequest
from garden_models.segmentation.mask_model import MaskRequest

_DEPTH_M = 2.0


def questions(stage: str, photos: int, size: tuple[int, int]) -> list[Any]:
    """Return what a model of a stage is asked about so many photos of (width, height) pixels.

    A model that takes photos one by one is asked once for each. Empty for a stage without
    made-up questions.
    """
    make = _MAKERS.get(stage)
    return [] if make is None else make(photos, size)


def stages() -> tuple[str, ...]:
    """Return the stages that have made-up questions."""
    return tuple(_MAKERS)


def picture(number: int, size: tuple[int, int]) -> UInt8[np.ndarray, "h w 3"]:
    """Return a photo of smooth shapes with grain; another one for each number."""
    width, height = size
    generator = np.random.default_rng(number)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    waves = generator.uniform(0.01, 0.08, (3, 2))
    shapes = [np.sin(a * x + b * y + number) + np.cos(b * x - a * y) for a, b in waves]
    grain = generator.normal(0, 6, (height, width, 3))
    return np.clip(128 + 50 * np.stack(shapes, axis=-1) + grain, 0, 255).astype(np.uint8)


def _geometry(photos: int, size: tuple[int, int]) -> list[Any]:
    return [GeometryRequest(tuple(picture(n, size) for n in range(photos)))]


def _masks(photos: int, size: tuple[int, int]) -> list[Any]:
    return [MaskRequest(picture(n, size), _boxes(size)) for n in range(photos)]


def _meshes(photos: int, size: tuple[int, int]) -> list[Any]:
    points = _points(size)
    mask = _mask(size)
    return [MeshRequest(picture(n, size), mask, points) for n in range(photos)]


def _poses(photos: int, size: tuple[int, int]) -> list[Any]:
    depth = np.full(size[::-1], _DEPTH_M)
    vertices, faces = _box_mesh()
    colours = np.full((len(vertices), 3), 128, np.uint8)
    return [
        PoseRequest(picture(n, size), depth, _camera(size), _mask(size), vertices, faces, colours,
                    np.eye(3))
        for n in range(photos)
    ]  # fmt: skip


def _boxes(size: tuple[int, int]) -> Float[np.ndarray, "1 4"]:
    width, height = size
    return np.array([[0.3 * width, 0.3 * height, 0.7 * width, 0.7 * height]])


def _mask(size: tuple[int, int]) -> Any:
    mask = np.zeros(size[::-1], bool)
    x0, y0, x1, y1 = _boxes(size)[0].astype(int)
    mask[y0:y1, x0:x1] = True
    return mask


def _camera(size: tuple[int, int]) -> Float[np.ndarray, "3 3"]:
    width, height = size
    return np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])


def _points(size: tuple[int, int]) -> Float[np.ndarray, "h w 3"]:
    width, height = size
    y, x = np.mgrid[0:height, 0:width] + 0.5
    K = _camera(size)
    rays = np.stack([(x - K[0, 2]) / K[0, 0], (y - K[1, 2]) / K[1, 1], np.ones_like(x)], axis=-1)
    return _DEPTH_M * rays


def _box_mesh() -> tuple[np.ndarray, np.ndarray]:
    import trimesh

    box = trimesh.creation.box((0.3, 0.4, 0.5))
    return np.asarray(box.vertices) - [0, 0.2, 0], np.asarray(box.faces)


_MAKERS: dict[str, Callable[[int, tuple[int, int]], list[Any]]] = {
    "reconstruct": _geometry,
    "segment": _masks,
    "mesh": _meshes,
    "place": _poses,
}
