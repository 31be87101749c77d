"""Path trace the photos and cast the truth rays with Mitsuba 3."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cameras import FOCAL_PX, HEIGHT, WIDTH, Shot
from .noise import Array
from .room import ROOM, Placed, Quad

EDGE_M = 0.0012  # longest edge of the painted triangles: under a pixel at 1 m
MAX_DEPTH = 5  # bounces of a path
KEY_FACTORS = np.array(
    (
        *(0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9),
        *(0xD6E8FEB86659FD93, 0xA0761D6478BD642F, 0xE7037ED1A0B428DB),
    ),
    dtype=np.uint64,
)


def choose_variant() -> str:
    """Return the fastest Mitsuba variant that works here, and set what it needs.

    Call it before Mitsuba is imported: the library's path is read then. ``llvm_ad_rgb``
    needs a libLLVM that suits the processor; a bad one aborts the process, so it is
    tried in another one. The package karellen-llvm-core carries a good one.
    """
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        for library in sorted((Path(sys.prefix) / "lib").glob("libLLVM.so.*")):
            os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    trial = (
        "import mitsuba as mi; mi.set_variant('llvm_ad_rgb');"
        "mi.render(mi.load_dict(mi.cornell_box()), spp=1).numpy()"
    )
    done = subprocess.run(
        [sys.executable, "-c", trial], capture_output=True, timeout=300, check=False
    )
    return "llvm_ad_rgb" if done.returncode == 0 else "scalar_rgb"


def linear(srgb: Array) -> Array:
    """Return linear light of sRGB values, both 0..1."""
    return np.asarray(np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4))


def srgb8(light: Array, exposure: float) -> NDArray[np.uint8]:
    """Return 8-bit sRGB of linear light, with highlights rolled off softly."""
    x = np.maximum(light * exposure, 0.0)
    x = np.where(x > 0.7, 0.7 + 0.3 * np.tanh((x - 0.7) / 0.3), x)
    srgb = np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(255.0 * np.clip(srgb, 0.0, 1.0)).astype(np.uint8)


class Tracer:
    """A Mitsuba scene of the room in the room frame."""

    def __init__(self, placed: list[Placed], quads: list[Quad], pictures: dict[str, Array]) -> None:
        """Build the scene; ``mitsuba.set_variant`` must have been called."""
        import mitsuba as mi

        self.mi = mi
        self.placed = placed
        self.sensors: dict[tuple[tuple[int, int], int], Any] = {}
        bsdfs = {name: self._picture(image) for name, image in pictures.items()}
        content: dict[str, Any] = {"type": "scene"}
        for quad in quads:
            content[quad.name] = {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f(rectangle_matrix(quad).tolist()),
                "bsdf": bsdfs[quad.texture],
            }
        meshes = {item.name: self._mesh(item) for item in placed}
        self.alone = {name: mi.load_dict({"type": "scene", name: m}) for name, m in meshes.items()}
        content.update(meshes)
        content.update(self._lights())
        self.scene = mi.load_dict(content)
        names = [shape.id() for shape in self.scene.shapes()]
        self.shape_number = {item.name: names.index(item.name) for item in placed}

    def _picture(self, image: Array) -> Any:
        bitmap = self.mi.Bitmap(linear(image[::-1]).astype(np.float32))  # row 0 lies at v = 0
        texture = {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "clamp"}
        return self.mi.load_dict(
            {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": texture}}
        )

    def _mesh(self, item: Placed) -> Any:
        vertices, normals, faces = subdivided(item)
        colour = linear(item.paint(vertices, normals))
        matrix = item.room_from_made
        bsdf = self.mi.load_dict(
            {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}
        )
        properties = self.mi.Properties()
        properties["mesh_bsdf"] = bsdf
        mesh = self.mi.Mesh(
            item.name, len(vertices), len(faces), has_vertex_normals=True, props=properties
        )
        mesh.add_attribute("vertex_color", 3, colour.ravel().astype(np.float32))
        values = self.mi.traverse(mesh)
        in_room = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        values["vertex_positions"] = in_room.ravel().astype(np.float32)
        values["vertex_normals"] = (normals @ matrix[:3, :3].T).ravel().astype(np.float32)
        values["faces"] = faces.ravel().astype(np.uint32)
        values.update()
        return mesh

    def _lights(self) -> dict[str, Any]:
        """A wide lamp under the ceiling and two windows behind the photographer."""
        a, b, h = ROOM
        ex, ey, ez = np.eye(3)
        lights = (
            ("lamp", np.array([0.7, 0.7, h - 0.02]), 1.9 * ey, 1.9 * ex, (2.9, 2.6, 2.15)),
            ("window_x", np.array([a - 0.01, 2.9, 0.9]), -1.7 * ey, 1.4 * ez, (4.2, 4.7, 5.4)),
            ("window_y", np.array([2.3, b - 0.01, 0.9]), 1.5 * ex, 1.4 * ez, (3.0, 3.2, 3.5)),
        )
        return {
            name: {
                "type": "rectangle",
                "to_world": self.mi.ScalarTransform4f(
                    rectangle_matrix(Quad(name, origin, right, up, "")).tolist()
                ),
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(light)}},
            }
            for name, origin, right, up, light in lights
        }

    def _sensor(self, shot: Shot, size: tuple[int, int], spp: int) -> Any:
        """Return the camera of one shot; ``spp`` 0: one ray through each pixel's centre.

        One sensor is kept for each size and only moved, so that Mitsuba's compiled
        kernels serve all shots.
        """
        width, height = size
        pose = shot.room_from_camera @ np.diag([-1.0, -1.0, 1.0, 1.0])  # Mitsuba: x left, y up
        to_world = self.mi.ScalarTransform4f(pose.tolist())
        if (size, spp) not in self.sensors:
            film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb"}
            random = {"type": "independent", "sample_count": spp}
            centre = {"type": "stratified", "sample_count": 1, "jitter": False}
            self.sensors[size, spp] = self.mi.load_dict(
                {
                    "type": "perspective",
                    "fov": float(np.degrees(2 * np.arctan(0.5 * WIDTH / FOCAL_PX))),
                    "fov_axis": "x",
                    "near_clip": 0.01,
                    "far_clip": 100.0,
                    "to_world": to_world,
                    "sampler": random if spp else centre,
                    "film": film | {"rfilter": {"type": "gaussian" if spp else "box"}},
                }
            )
        sensor = self.sensors[size, spp]
        values = self.mi.traverse(sensor)
        values["to_world"] = to_world
        values.update()
        return sensor

    def photo(
        self, shot: Shot, spp: int, seed: int, size: tuple[int, int] = (WIDTH, HEIGHT)
    ) -> Array:
        """Return linear light ``(h, w, 3)`` of one photo.

        The paint is kept as traced; only the light that falls on it is smoothed.
        """
        sensor = self._sensor(shot, size, spp)
        integrator = self.mi.load_dict(
            {
                "type": "aov",
                "aovs": "albedo:albedo,normal:sh_normal,place:position",
                "light": {"type": "path", "max_depth": MAX_DEPTH, "rr_depth": MAX_DEPTH + 1},
            }
        )
        image = self.mi.render(self.scene, sensor=sensor, integrator=integrator, spp=spp, seed=seed)
        layers = np.array(image, dtype=np.float32)
        light, albedo, normal, place = np.split(layers[..., -12:], 4, axis=2)
        paint = np.maximum(albedo, 0.02)
        return np.asarray(smooth_light(light / paint, unit(normal), place) * paint, np.float64)

    def truth(self, shot: Shot, size: tuple[int, int]) -> tuple[Array, NDArray[np.int64]]:
        """Return z-depth (metres) and the seen object's number (-1: none), ``(h, w)``.

        One ray goes through each pixel's centre.
        """
        layers = self._cast(self.scene, shot, size)
        pose = shot.room_from_camera
        depth = (layers[..., :3] - pose[:3, 3]) @ pose[:3, 2]
        shape = np.round(layers[..., 3]).astype(np.int64) - 1  # Mitsuba counts from 1
        number = np.full(shape.shape, -1)
        for i, item in enumerate(self.placed):
            number[shape == self.shape_number[item.name]] = i
        return depth, number

    def whole(self, shot: Shot, size: tuple[int, int], name: str) -> NDArray[np.bool_]:
        """Return the pixels ``(h, w)`` of one object as if nothing stood before it."""
        return np.asarray(self._cast(self.alone[name], shot, size)[..., 3] > 0.5)

    def _cast(self, scene: Any, shot: Shot, size: tuple[int, int]) -> Array:
        sensor = self._sensor(shot, size, spp=0)
        integrator = self.mi.load_dict({"type": "aov", "aovs": "place:position,shape:shape_index"})
        image = self.mi.render(scene, sensor=sensor, integrator=integrator, spp=1, seed=0)
        return np.array(image, dtype=np.float64)


def smooth_light(light: Array, normal: Array, place: Array, reach: int = 4) -> Array:
    """Average irradiance ``(h, w, 3)`` over near pixels of the same smooth surface.

    A neighbour counts by how well its normal agrees and how near it lies to the tangent
    plane, so light never leaks over edges; shadows soften by a few pixels.
    """
    spread = 0.004 + 0.002 * np.abs(place - np.roll(place, 1, axis=1)).sum(axis=2)
    total = np.zeros_like(light)
    weights = np.zeros_like(light[..., :1])
    padded = [
        np.pad(a, ((reach, reach), (reach, reach), (0, 0)), "edge") for a in (light, normal, place)
    ]
    h, w = light.shape[:2]
    for dy in range(2 * reach + 1):
        for dx in range(2 * reach + 1):
            near, its_normal, its_place = (a[dy : dy + h, dx : dx + w] for a in padded)
            off_plane = np.abs(((its_place - place) * normal).sum(axis=2)) / spread
            agree = np.clip((normal * its_normal).sum(axis=2), 0.0, 1.0) ** 32
            falloff = np.exp(-((dy - reach) ** 2 + (dx - reach) ** 2) / (2.0 * (0.5 * reach) ** 2))
            weight = (falloff * agree * np.exp(-(off_plane**2)))[..., None]
            total += weight * near
            weights += weight
    return np.asarray(total / np.maximum(weights, 1e-9))


def rectangle_matrix(quad: Quad) -> Array:
    """Return the 4x4 that takes Mitsuba's rectangle (-1..1, uv up) to the quad."""
    normal = np.cross(quad.right, quad.up)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1] = quad.right / 2, quad.up / 2
    matrix[:3, 2] = normal / np.linalg.norm(normal)
    matrix[:3, 3] = quad.origin + quad.right / 2 + quad.up / 2
    return matrix


def subdivided(item: Placed) -> tuple[Array, Array, NDArray[np.int64]]:
    """Cut the faces until every edge is under ``EDGE_M``; the surface stays the same.

    Returns vertices, unit normals (of faces unless the shape is smooth) and faces.
    """
    shape = item.shape
    corners = shape.vertices[shape.faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    at_vertex = np.zeros_like(shape.vertices)
    for k in range(3):
        np.add.at(at_vertex, shape.faces[:, k], normal)
    normals = at_vertex[shape.faces] if shape.smooth else np.repeat(normal[:, None], 3, axis=1)
    soup = np.concatenate([corners, unit(normals)], axis=2)
    done = []
    while len(soup):
        edges = np.linalg.norm(soup[:, [1, 2, 0], :3] - soup[:, :, :3], axis=2)
        longest = edges.argmax(axis=1)
        fine = edges.max(axis=1) <= EDGE_M
        done.append(soup[fine])
        soup, longest = soup[~fine], longest[~fine]
        rows = np.arange(len(soup))
        a, b, c = (soup[rows, (longest + k) % 3] for k in range(3))
        m = 0.5 * (a + b)
        soup = np.concatenate([np.stack([a, m, c], 1), np.stack([m, b, c], 1)])
    flat = np.concatenate(done).reshape(-1, 6)
    # Merge equal corners by one 64-bit key each: sorting whole rows would take a minute.
    bits = np.round(flat * 1e6).astype(np.int64).astype(np.uint64)
    key = (bits * KEY_FACTORS).sum(axis=1, dtype=np.uint64)
    _, first, index = np.unique(key, return_index=True, return_inverse=True)
    return flat[first, :3], unit(flat[first, 3:]), index.reshape(-1, 3).astype(np.int64)


def unit(vectors: Array) -> Array:
    """Return the vectors at length 1 along the last axis."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-15))
