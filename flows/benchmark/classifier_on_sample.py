"""Score point classifiers on the sample capture: real stereo, exact meshes, true labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from flows.benchmark.corner_truth import CornerTruth, TruthObject, load_corner
from flows.training.stereo_residuals import reconstructed_with_cameras
from garden_models.disentanglement.label import relaxed_box
from garden_models.disentanglement.network.condition_distance import Surface
from garden_models.disentanglement.protocol import Crop, PlacedMesh, ViewEvidence, classifier
from garden_models.disentanglement.training.pair import Condition
from garden_models.geometry.rigid import homogeneous, invert_rigid, transform_points
from garden_models.metrics.classification import confusion
from garden_models.progress import silent
from garden_models.scene import PointCloud, Reconstruction
from storage import Store

NEAR_TRUTH_M = 0.015
"""A point farther than this from every true surface is a mistake of stereo without an owner."""
RELAXED = 0.35


def sample_rows(folder: Path, store: Store, weights: str = "") -> list[dict[str, Any]]:
    """Return F1 and the other scores of each method, for each object with its true mesh.

    The geometric rule gets the true masks; the network gets none.
    """
    truth = load_corner(folder)
    scene = reconstructed_with_cameras(folder, store)
    gv_from_world = upright(truth.down_world)
    points_gv = _in_gv(scene.points_world, gv_from_world)
    owner = _owners(truth, scene.points_world.xyz)
    rows = []
    for index, item in enumerate(truth.objects):
        mesh = PlacedMesh(transform_points(gv_from_world, item.vertices_world), item.faces)
        near = relaxed_box(points_gv, mesh, RELAXED)
        views = _views(truth, item, scene, gv_from_world)
        crop = Crop(points_gv.subset(near), mesh, views, None)
        asked, is_object = owner[near] >= -1, owner[near] == index
        for method in ("network", "geometric"):
            given = weights if method == "network" else ""
            labels = classifier(method, given)(crop, silent) >= 0.5
            rows.append(_row(item.name, method, labels[asked], is_object[asked]))
        distance = Surface(_condition(mesh)).ask(crop.points_gv.xyz).distance
        labels = distance < 0.01 * mesh.size
        rows.append(_row(item.name, "within 1 % of the mesh", labels[asked], is_object[asked]))
    return rows


def upright(down: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """Return a rotation (4x4) whose second row is ``down``."""
    y = down / np.linalg.norm(down)
    x = np.cross(y, np.eye(3)[int(np.argmin(np.abs(y)))])
    x /= np.linalg.norm(x)
    out = np.eye(4)
    out[:3, :3] = np.stack([x, y, np.cross(x, y)])
    return out


def _owners(truth: CornerTruth, points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
    """Return the object that each point belongs to; -1 for the room, -2 for nothing."""
    meshes = [(truth.room_vertices_world, truth.room_faces)]
    meshes += [(item.vertices_world, item.faces) for item in truth.objects]
    distance = np.stack([Surface(_triangles(v, f)).ask(points).distance for v, f in meshes])
    nearest = distance.argmin(axis=0) - 1
    return np.where(distance.min(axis=0) <= NEAR_TRUTH_M, nearest, -2)


def _triangles(vertices: np.ndarray, faces: np.ndarray) -> Condition:
    corners = np.asarray(vertices, np.float64)[faces]
    return Condition(corners.mean(axis=1), np.arange(len(corners)), corners)


def _condition(mesh: PlacedMesh) -> Condition:
    return _triangles(mesh.vertices_gv, mesh.faces)


def _in_gv(points: PointCloud, gv_from_world: Float[np.ndarray, "4 4"]) -> PointCloud:
    return PointCloud(
        transform_points(gv_from_world, np.asarray(points.xyz, np.float64)),
        points.rgb,
        points.normal @ gv_from_world[:3, :3].T,
        points.spacing,
        points.confidence,
    )


def _views(
    truth: CornerTruth,
    item: TruthObject,
    scene: Reconstruction,
    gv_from_world: Float[np.ndarray, "4 4"],
) -> tuple[ViewEvidence, ...]:
    world_from_gv = invert_rigid(gv_from_world)
    return tuple(
        ViewEvidence(
            view.K,
            homogeneous(view.camera_from_world) @ world_from_gv,
            view.depth,
            _sized(truth.mask(item.name, view.photo), view.size),
        )
        for view in scene.views
    )


def _sized(mask: Bool[np.ndarray, "h w"], size: tuple[int, int]) -> Bool[np.ndarray, "h w"]:
    small = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(small > 0)


def _row(
    name: str, method: str, labels: Bool[np.ndarray, " n"], truth: Bool[np.ndarray, " n"]
) -> dict[str, Any]:
    counts = confusion(labels, truth)
    return {
        "object": name,
        "method": method,
        "points": len(truth),
        "F1": round(counts.f1, 4),
        "IoU": round(counts.iou, 4),
        "accuracy": round(counts.accuracy, 4),
        "precision": round(counts.precision, 4),
        "recall": round(counts.recall, 4),
    }
