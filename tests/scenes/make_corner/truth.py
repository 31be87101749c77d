"""Write what is known exactly: cameras, depth, masks, objects, supports and targets.

The world of the truth is the room turned and moved at random (seeded), in metres, so its
axes say nothing about up.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import png
from .cameras import HEIGHT, WIDTH, Shot, intrinsics
from .noise import Array
from .render import Tracer
from .room import ROOM, TABLE_HEIGHT, TABLE_LOW, TABLE_SIZE, Placed, Quad

DEPTH_UNIT_M = 1e-4
DEPTH_SHOTS = (1, 6, 11, 16, 22)
DEPTH_SIZE = (WIDTH // 2, HEIGHT // 2)


def world_from_room(seed: int = 2) -> Array:
    """Return the random rigid transform (4x4) from the room to the world of the truth."""
    rng = np.random.default_rng(seed)
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, 3] = rng.uniform(-1.0, 1.0, 3)
    return matrix


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write ``content`` readably."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def rounded(values: Array, digits: int = 10) -> Any:
    """Return nested lists of ``values`` without meaningless digits."""
    return (np.round(np.asarray(values, dtype=np.float64), digits) + 0.0).tolist()


def write_cameras(folder: Path, shots: list[Shot]) -> None:
    """Write ``cameras.json`` (OpenCV) and ``transforms.json`` (nerfstudio)."""
    world = world_from_room()
    up = world[:3, 2]
    frames, given = [], []
    K, depth_K = intrinsics(), intrinsics(DEPTH_SIZE[0])
    for number, shot in enumerate(shots):
        pose = world @ shot.room_from_camera
        frame: dict[str, Any] = {"file": f"images/{shot.photo}", "w": WIDTH, "h": HEIGHT}
        frame |= {"K": rounded(K), "c2w": rounded(pose)}
        if number in DEPTH_SHOTS:
            frame |= {"depth": f"depth/{Path(shot.photo).stem}.png", "depth_K": rounded(depth_K)}
        frames.append(frame)
        given.append(
            {
                "file_path": f"images/{shot.photo}",
                "transform_matrix": rounded(pose @ np.diag([1.0, -1.0, -1.0, 1.0])),
            }
        )
    write_json(
        folder / "cameras.json",
        {
            "convention": "OpenCV: x right, y down, z forward; c2w = camera-to-world 4x4; "
            "pixel centres at +0.5",
            "world_up": rounded(up),
            "gravity_down": rounded(-up),
            "world_up_accuracy": "exact",
            "scale": "metric",
            "note": "path traced; no lens distortion",
            "depth_unit": "16-bit PNG of z-depth, 0.1 millimetres, 0 = no reading; "
            "half the photo's size, camera matrix depth_K",
            "depth_unit_m": DEPTH_UNIT_M,
            "up_in_transforms_json": rounded(up),
            "frames": frames,
        },
    )
    camera = {"camera_model": "OPENCV", "w": WIDTH, "h": HEIGHT}
    lens = {"fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2], "cy": K[1, 2]}
    write_json(folder / "transforms.json", camera | lens | {"frames": given})


def write_views(folder: Path, tracer: Tracer, shots: list[Shot]) -> dict[str, dict[str, Any]]:
    """Write depth maps and masks.

    Returns, for each object and photo, the visible share (0..1) and the box of its
    visible pixels ``[x0, y0, x1, y1]`` (None where it is not seen).
    """
    seen: dict[str, dict[str, Any]] = {item.name: {} for item in tracer.placed}
    for number, shot in enumerate(shots):
        stem = Path(shot.photo).stem
        if number in DEPTH_SHOTS:
            depth, _ = tracer.truth(shot, DEPTH_SIZE)
            steps = np.round(depth / DEPTH_UNIT_M).astype(np.uint16)
            png.write_grey16(folder / "depth" / f"{stem}.png", steps)
        _, labels = tracer.truth(shot, (WIDTH, HEIGHT))
        for index, item in enumerate(tracer.placed):
            mask = labels == index
            png.write_mask(folder / "masks" / item.name / f"{stem}.png", mask)
            whole = tracer.whole(shot, (WIDTH, HEIGHT), item.name).sum()
            share = float(mask.sum() / max(whole, 1))
            seen[item.name][shot.photo] = {
                "visible_share": round(share, 4),
                "pixels": int(mask.sum()),
                "box": box_of(mask),
            }
    return seen


def box_of(mask: NDArray[np.bool_]) -> list[int] | None:
    """Return ``[x0, y0, x1, y1]`` around the True pixels, or None if there are none."""
    if not mask.any():
        return None
    columns, rows = np.flatnonzero(mask.any(axis=0)), np.flatnonzero(mask.any(axis=1))
    return [int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1]


def write_objects(
    folder: Path, placed: list[Placed], quads: list[Quad], seen: dict[str, dict[str, Any]]
) -> None:
    """Write meshes in their upright object frames, poses, supports and the bare room."""
    world = world_from_room()
    listed = []
    for item in placed:
        to_object = item.object_from_made
        vertices = item.shape.vertices @ to_object[:3, :3].T + to_object[:3, 3]
        pose = world @ item.room_from_made @ np.linalg.inv(to_object)
        colour = item.paint(item.shape.vertices, vertex_normals(item))
        path = folder / "objects" / f"{item.name}.npz"
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(
            path,
            vertices=vertices.astype(np.float32),
            faces=item.shape.faces.astype(np.uint16),
            vertex_rgb=np.round(255 * colour).astype(np.uint8),
        )
        listed.append(
            {
                "name": item.name,
                "mesh": f"objects/{item.name}.npz",
                "world_from_object": rounded(pose),
                "yaw_symmetric": item.yaw_symmetric,
                "size_m": rounded(np.ptp(vertices, axis=0), 6),
                "supported_by": "table",
                "touches": {"house": ["duck"], "duck": ["house"]}.get(item.name, []),
                "views": seen[item.name],
            }
        )
    (x, y), (a, b) = TABLE_LOW, TABLE_SIZE
    outlines = {
        "floor": (0.0, [(0, 0), (ROOM[0], 0), (ROOM[0], ROOM[1]), (0, ROOM[1])]),
        "table": (TABLE_HEIGHT, [(x, y), (x + a, y), (x + a, y + b), (x, y + b)]),
    }
    supports = []
    for name, (height, outline) in outlines.items():
        corners = np.array([(u, v, height) for u, v in outline])
        in_world = corners @ world[:3, :3].T + world[:3, 3]
        supports.append(
            {"name": name, "kind": name, "height_above_floor_m": height}
            | {"outline_world": rounded(in_world)}
        )
    write_json(
        folder / "objects.json",
        {
            "object_frame": "upright: y down, origin on the support at the centre of the box "
            "around the base, vertices have y <= 0; metres",
            "objects": listed,
            "supports": supports,
            "room_mesh": "room.npz (vertices_world, faces): everything but the objects",
        },
    )
    corners = np.concatenate(
        [q.origin + np.array([0 * q.up, q.right, q.right + q.up, q.up]) for q in quads]
    )
    faces = np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(len(quads))[:, None, None]
    np.savez_compressed(
        folder / "room.npz",
        vertices_world=corners @ world[:3, :3].T + world[:3, 3],
        faces=faces.reshape(-1, 3).astype(np.uint16),
    )


def vertex_normals(item: Placed) -> Array:
    """Return area-weighted unit normals of the shape's vertices."""
    corners = item.shape.vertices[item.shape.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.zeros_like(item.shape.vertices)
    for k in range(3):
        np.add.at(total, item.shape.faces[:, k], normal)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-15))


def write_targets(path: Path, seen: dict[str, dict[str, Any]], seed: int = 3) -> None:
    """Write one box an object, in the photo that shows the most of it, loosely drawn.

    Each side lies 1 to 4 % of the box's size outside the visible pixels.
    """
    rng = np.random.default_rng(seed)
    targets = []
    for name, views in seen.items():
        whole = {p: v for p, v in views.items() if v["box"] and inside_photo(v["box"])}
        fullest = max(v["visible_share"] for v in whole.values())
        clear = {p: v for p, v in whole.items() if v["visible_share"] > fullest - 0.01}
        photo = max(clear, key=lambda p: clear[p]["pixels"])
        x0, y0, x1, y1 = clear[photo]["box"]
        slack = rng.uniform(0.01, 0.04, 4) * np.array([x1 - x0, y1 - y0, x1 - x0, y1 - y0])
        loose = np.array([x0, y0, x1, y1]) + slack * [-1, -1, 1, 1]
        box = np.clip(np.round(loose), 0, [WIDTH, HEIGHT, WIDTH, HEIGHT]).astype(int)
        targets.append({"name": name, "image": photo, "box": box.tolist()})
    write_json(path, {"targets": targets})


def inside_photo(box: list[int]) -> bool:
    """Tell whether a box keeps clear of the photo's border by 5 pixels."""
    return min(box[0], box[1]) >= 5 and box[2] <= WIDTH - 5 and box[3] <= HEIGHT - 5
