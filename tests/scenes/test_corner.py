"""The sample capture is consistent with itself: photos, cameras, depth, masks, meshes."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from jaxtyping import Bool, Float, Int

from tests.scenes.corner_truth import CornerTruth, TruthObject, TruthView, load_corner
from tests.scenes.make_corner import cameras as made_cameras
from tests.scenes.make_corner import room as made_room
from tests.scenes.make_corner.truth import world_from_room

NAMES = ("house", "duck", "jar")


@pytest.fixture(scope="module")
def corner() -> CornerTruth:
    return load_corner()


@pytest.fixture(scope="module")
def scene(corner: CornerTruth) -> trimesh.Trimesh:
    """Objects first, then the room, so that a face's number tells what it belongs to."""
    parts = [(item.vertices_world, item.faces) for item in corner.objects]
    parts.append((corner.room_vertices_world, corner.room_faces))
    return trimesh.util.concatenate(
        [trimesh.Trimesh(v, f, process=False, validate=False) for v, f in parts]
    )


def cast(
    corner: CornerTruth,
    scene: trimesh.Trimesh,
    photo: str,
    K: Float[np.ndarray, "3 3"],
    pixels: Float[np.ndarray, "n 2"],
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Return z-depth (metres) and the object's index (3: room) seen through ``pixels``."""
    pose = corner.view(photo).world_from_camera
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(K).T @ pose[:3, :3].T
    origins = np.tile(pose[:3, 3], (len(rays), 1))
    face, ray, place = scene.ray.intersects_id(
        origins, rays, multiple_hits=False, return_locations=True
    )
    depth = np.zeros(len(rays))
    depth[ray] = (place - pose[:3, 3]) @ pose[:3, 2]
    starts = np.cumsum([len(item.faces) for item in corner.objects])
    owner = np.full(len(rays), -1)
    owner[ray] = np.searchsorted(starts, face, side="right")
    return depth, owner


def pixel_centres(width: int, height: int) -> Float[np.ndarray, "n 2"]:
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.column_stack([x.ravel(), y.ravel()])


def test_the_folder_is_under_4_mb_and_every_photo_opens(corner: CornerTruth) -> None:
    files = [path for path in corner.folder.rglob("*") if path.is_file()]
    assert sum(path.stat().st_size for path in files) < 4_000_000
    assert len(corner.views) == len(list(corner.images.iterdir())) == 24
    for view in corner.views:
        assert corner.photo(view.photo).shape == (view.size[1], view.size[0], 3)


def test_photos_are_exposed_well_and_textured(corner: CornerTruth) -> None:
    for view in corner.views:
        grey = cv2.cvtColor(corner.photo(view.photo), cv2.COLOR_RGB2GRAY)
        assert 80 < np.median(grey) < 170
        assert np.mean(grey > 252) < 0.02
        tiles = grey[: 32 * 18, : 32 * 24].reshape(18, 32, 24, 32)
        assert np.mean(tiles.std(axis=(1, 3)) < 3.0) < 0.01


def test_given_cameras_are_the_true_cameras(corner: CornerTruth) -> None:
    given = json.loads(corner.transforms.read_text(encoding="utf-8"))
    assert len(given["frames"]) == len(corner.views)
    for frame, view in zip(given["frames"], corner.views, strict=True):
        assert Path(frame["file_path"]).name == view.photo
        opencv = np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1])
        np.testing.assert_allclose(opencv, view.world_from_camera, atol=1e-9)
        rotation = view.world_from_camera[:3, :3]
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) > 0
        assert view.K[0, 0] == given["fl_x"] and view.K[1, 2] == given["cy"]


def test_gravity_is_the_normal_of_floor_and_table(corner: CornerTruth) -> None:
    assert np.linalg.norm(corner.down_world) == pytest.approx(1.0)
    heights = {s.name: s.outline_world @ -corner.down_world for s in corner.supports}
    for height in heights.values():
        assert np.ptp(height) < 1e-9
    rise = heights["table"].mean() - heights["floor"].mean()
    assert rise == pytest.approx(corner.support("table").height_above_floor_m)
    # The world's own axes give nothing away.
    assert np.abs(corner.down_world).max() < 0.95


@pytest.mark.parametrize("name", NAMES)
def test_meshes_are_closed_and_stand_on_the_table(corner: CornerTruth, name: str) -> None:
    item = corner.object(name)
    mesh = trimesh.Trimesh(item.vertices_object, item.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert item.vertices_object[:, 1].max() == 0.0
    np.testing.assert_allclose(mesh.extents, item.size_m, atol=1e-5)
    np.testing.assert_allclose(item.world_from_object[:3, 1], corner.down_world, atol=1e-9)
    table = (corner.support("table").outline_world @ corner.down_world).mean()
    assert (item.vertices_world @ corner.down_world).max() == pytest.approx(table, abs=1e-6)
    # Stable: the centre of mass is well over the base.
    base = item.vertices_object[item.vertices_object[:, 1] == 0.0][:, [0, 2]]
    hull = cv2.convexHull(base.astype(np.float32))
    centre = mesh.center_mass[[0, 2]].astype(np.float32)
    assert cv2.pointPolygonTest(hull, centre.tolist(), True) > 0.02


def in_frame_of(reference: TruthObject, item: TruthObject) -> Float[np.ndarray, "v 3"]:
    pose = np.linalg.inv(reference.world_from_object)
    return item.vertices_world @ pose[:3, :3].T + pose[:3, 3]


def test_duck_touches_the_house_without_going_into_it(corner: CornerTruth) -> None:
    house, duck = corner.object("house"), corner.object("duck")
    assert house.touches == ("duck",) and duck.touches == ("house",)
    points = in_frame_of(house, duck)
    wall = house.vertices_object[house.vertices_object[:, 1] == 0.0][:, 0].min()
    contact = points[points[:, 0].argmax()]
    assert contact[0] == pytest.approx(wall, abs=1e-6)
    on_wall = house.vertices_object[np.isclose(house.vertices_object[:, 0], wall, atol=1e-6)]
    assert on_wall[:, 1].min() < contact[1] < 0.0
    assert np.abs(contact[2]) < np.abs(on_wall[:, 2]).max()
    solid = trimesh.Trimesh(house.vertices_object, house.faces, process=False)
    assert not solid.contains(points[points[:, 0] < wall - 1e-6]).any()


@pytest.mark.parametrize("number", [0, 6, 16, 22])
def test_masks_are_what_rays_through_the_pixels_meet(
    corner: CornerTruth, scene: trimesh.Trimesh, number: int
) -> None:
    view = corner.views[number]
    _, owner = cast(corner, scene, view.photo, view.K, pixel_centres(*view.size))
    for index, item in enumerate(corner.objects):
        mask = corner.mask(item.name, view.photo)
        met: Bool[np.ndarray, "h w"] = (owner == index).reshape(mask.shape)
        assert np.sum(mask & met) / np.sum(mask | met) > 0.998
        rows, columns = np.nonzero(mask)
        box = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
        assert box == item.visible_box[view.photo]


def test_depth_is_how_far_the_rays_go(corner: CornerTruth, scene: trimesh.Trimesh) -> None:
    assert len(corner.depths) >= 4
    for photo, truth in corner.depths.items():
        height, width = truth.depth.shape
        depth, owner = cast(corner, scene, photo, truth.K, pixel_centres(width, height))
        error = np.abs(depth.reshape(height, width) - truth.depth)
        assert np.mean(error > 0.0002) < 0.002
        assert truth.depth.min() > 0.3 and (owner >= 0).all()


def test_photos_agree_with_depth_and_cameras(corner: CornerTruth, scene: trimesh.Trimesh) -> None:
    """A photo warped into its neighbour by the truth must look like the neighbour."""
    for photo, truth in corner.depths.items():
        other = nearest_view(corner, photo)
        height, width = truth.depth.shape
        rays = np.column_stack([pixel_centres(width, height), np.ones(width * height)])
        points = (rays @ np.linalg.inv(truth.K).T) * truth.depth.reshape(-1, 1)
        pose = corner.view(photo).world_from_camera
        world = points @ pose[:3, :3].T + pose[:3, 3]
        local = world @ other.camera_from_world[:, :3].T + other.camera_from_world[:, 3]
        pixel = local @ other.K.T
        pixel = pixel[:, :2] / pixel[:, 2:]
        depth, _ = cast(corner, scene, other.photo, other.K, pixel)
        unhidden = np.abs(depth - local[:, 2]) < 0.002
        inside = ((pixel > 2) & (pixel < np.array(other.size) - 3)).all(axis=1)
        grey = [cv2.cvtColor(corner.photo(p), cv2.COLOR_RGB2GRAY) for p in (photo, other.photo)]
        mine = cv2.resize(grey[0], (width, height), interpolation=cv2.INTER_AREA).reshape(-1)
        # The mean of 2x2 pixels from (i, j) lies at (i + 1, j + 1) in pixel coordinates.
        halved = cv2.blur(grey[1], (2, 2), anchor=(0, 0))
        at = (pixel - 1.0).astype(np.float32).reshape(height, width, 2)
        theirs = cv2.remap(halved, at, None, cv2.INTER_LINEAR).reshape(-1)
        both = unhidden & inside
        assert both.mean() > 0.4
        assert np.corrcoef(mine[both], theirs[both])[0, 1] > 0.9


def nearest_view(corner: CornerTruth, photo: str) -> TruthView:
    """Return the other view whose camera stands nearest to that of ``photo``."""
    at = corner.view(photo).world_from_camera[:3, 3]
    others = [view for view in corner.views if view.photo != photo]
    return min(others, key=lambda view: np.linalg.norm(view.world_from_camera[:3, 3] - at))


def test_targets_are_drawn_loosely_around_what_is_seen(corner: CornerTruth) -> None:
    listed = json.loads(corner.targets.read_text(encoding="utf-8"))["targets"]
    assert sorted(target["name"] for target in listed) == sorted(NAMES)
    for item in corner.objects:
        seen = np.array(item.visible_box[item.target_photo], dtype=float)
        slack = (np.array(item.target_box) - seen) * [-1, -1, 1, 1]
        size = np.tile(seen[2:] - seen[:2], 2)
        assert (slack >= 0).all() and (slack <= 0.05 * size + 1).all()
        assert item.visible_share[item.target_photo] > 0.95


def test_every_object_is_seen_well_and_one_is_partly_hidden(corner: CornerTruth) -> None:
    shares = {item.name: np.array(list(item.visible_share.values())) for item in corner.objects}
    for share in shares.values():
        assert np.sum(share > 0.9) >= 8
        assert share.max() <= 1.0
    assert sum(np.sum((share > 0.05) & (share < 0.7)) for share in shares.values()) >= 3


def test_neighbouring_photos_overlap(corner: CornerTruth) -> None:
    """Every photo has another within 16 degrees, seen from the objects."""
    middle = np.mean([item.world_from_object[:3, 3] for item in corner.objects], axis=0)
    towards = np.stack([view.world_from_camera[:3, 3] - middle for view in corner.views])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip(towards @ towards.T, -1, 1))) + 360 * np.eye(len(towards))
    assert angle.min(axis=1).max() < 16.0


def test_the_script_still_makes_this_capture(corner: CornerTruth) -> None:
    """Shapes, poses and cameras come out of the script as they lie in the folder."""
    world = world_from_room()
    for made, item in zip(made_room.objects(), corner.objects, strict=True):
        assert made.name == item.name
        vertices = made.shape.vertices @ (world @ made.room_from_made)[:3, :3].T
        vertices += (world @ made.room_from_made)[:3, 3]
        np.testing.assert_allclose(vertices, item.vertices_world, atol=1e-6)
    for shot, view in zip(made_cameras.shots(), corner.views, strict=True):
        np.testing.assert_allclose(world @ shot.room_from_camera, view.world_from_camera, atol=1e-8)


def test_the_script_explains_itself() -> None:
    folder = Path(__file__).resolve().parent / "make_corner"
    done = subprocess.run(
        [sys.executable, str(folder), "--help"], capture_output=True, text=True, check=True
    )
    assert "--preview" in done.stdout
