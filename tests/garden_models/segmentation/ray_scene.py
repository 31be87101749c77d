"""Ray-cast small rooms of boxes and ellipsoids, with exact masks, as reconstructions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from garden_models.geometry.camera import pixel_grid, pixel_rays
from garden_models.geometry.rigid import homogeneous, invert_rigid, rigid, transform_points
from garden_models.geometry.rotation import axis_angle, yaw_gv
from garden_models.scene import GravityView, PointCloud, Reconstruction, Scale, Target, View


@dataclass(frozen=True)
class Solid:
    """A box or an ellipsoid in GV: centre, half sizes, yaw, base colour, label."""

    shape: str
    centre: tuple[float, float, float]
    half: tuple[float, float, float]
    colour: tuple[int, int, int]
    label: int
    yaw: float = 0.0
    texture: float = 40.0
    frequency: float = 40.0


@dataclass(frozen=True)
class RayScene:
    """A room in GV (y down), its cameras, and what they see."""

    solids: tuple[Solid, ...]
    cameras_from_gv: list[np.ndarray]
    size: tuple[int, int] = (200, 150)
    focal: float = 200.0
    depth_noise: float = 0.002
    holes: tuple[int, ...] = field(default=())
    """Labels without stereo depth (textureless)."""
    seed: int = 0

    @property
    def K(self) -> np.ndarray:  # noqa: N802
        return np.array(
            [[self.focal, 0, self.size[0] / 2], [0, self.focal, self.size[1] / 2], [0, 0, 1.0]]
        )


def look_at(eye: tuple[float, float, float], at: tuple[float, float, float]) -> np.ndarray:
    """Return camera_from_gv of a level camera at ``eye`` that looks at ``at``."""
    forward = np.subtract(at, eye)
    z = forward / np.linalg.norm(forward)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return rigid(rotation, -rotation @ np.array(eye))


def orbit(
    count: int, radius: float, height: float, spread_deg: float = 360.0, start_deg: float = 0.0
) -> list[np.ndarray]:
    """Return cameras around the y axis, ``height`` above y = 0, looking at the origin."""
    angles = np.radians(start_deg) + np.radians(spread_deg) * np.arange(count) / count
    return [
        look_at((radius * np.sin(a), -height, -radius * np.cos(a)), (0.0, -0.1, 0.0))
        for a in angles
    ]


def _hit(solid: Solid, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance (in rays) of the nearest hit and the normal there; inf: none."""
    turn = yaw_gv(solid.yaw)
    half = np.array(solid.half)
    o = (origin - np.array(solid.centre)) @ turn / half
    d = rays @ turn / half
    if solid.shape == "box":
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = (-1 - o) / d, (1 - o) / d
        enter = np.minimum(near, far)
        t, leave = enter.max(1), np.maximum(near, far).min(1)
        axis = enter.argmax(1)
        normal = np.zeros_like(d)
        rows = np.arange(len(d))
        normal[rows, axis] = -np.sign(d[rows, axis])
        valid = (t < leave) & (t > 1e-6)
    else:
        a, b, c = (d * d).sum(1), (d * o).sum(1), (o * o).sum() - 1
        root = b * b - a * c
        t = (-b - np.sqrt(np.maximum(root, 0))) / a
        normal = (o + d * t[:, None]) / half
        valid = (root > 0) & (t > 1e-6)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    return np.where(valid, t, np.inf), normal @ turn.T


def _paint(solid: Solid, points: np.ndarray) -> np.ndarray:
    """Return a smooth random texture, fixed to the solid."""
    rng = np.random.default_rng(solid.label + 17)
    waves = rng.normal(size=(3, 8)) * solid.frequency
    phase = rng.uniform(0, 2 * np.pi, 8)
    shade = np.sin(points @ waves + phase) @ rng.normal(size=(8, 3)) / 4
    return np.clip(np.array(solid.colour) + solid.texture * shade, 0, 255)


def render(scene: RayScene) -> tuple[Reconstruction, GravityView, list[np.ndarray]]:
    """Return the reconstruction in a turned world, its gravity, and label images."""
    rng = np.random.default_rng(scene.seed)
    world_from_gv = rigid(axis_angle(np.array([0.3, 1.0, -0.5]), 0.7), np.array([0.5, -1.0, 2.0]))
    width, height = scene.size
    rays_camera = pixel_rays(pixel_grid(height, width), scene.K).reshape(-1, 3)
    views, labels, samples = [], [], []
    for index, camera_from_gv in enumerate(scene.cameras_from_gv):
        gv_from_camera = invert_rigid(camera_from_gv)
        rays, origin = rays_camera @ gv_from_camera[:3, :3].T, gv_from_camera[:3, 3]
        best, which = np.full(len(rays), np.inf), np.full(len(rays), -1)
        normals = np.zeros_like(rays)
        for number, solid in enumerate(scene.solids):
            t, normal = _hit(solid, origin, rays)
            nearer = t < best
            best[nearer], which[nearer], normals[nearer] = t[nearer], number, normal[nearer]
        seen = which >= 0
        points = origin + rays * np.where(seen, best, 0)[:, None]
        rgb = np.zeros((len(rays), 3))
        label = np.zeros(len(rays), int)
        for number, solid in enumerate(scene.solids):
            mine = which == number
            rgb[mine] = _paint(solid, points[mine])
            rgb[mine] *= 0.75 + 0.25 * np.abs(normals[mine] @ [0.36, -0.8, 0.48])[:, None]
            label[mine] = solid.label
        depth = np.where(seen, best, 0) * (1 + scene.depth_noise * rng.normal(size=len(rays)))
        valid = seen & ~np.isin(label, scene.holes) & (rng.random(len(rays)) > 0.05)
        depth = np.where(valid, depth, 0)
        rgb8 = np.clip(rgb + rng.normal(0, 2, rgb.shape), 0, 255).astype(np.uint8)
        noisy = origin + rays * depth[:, None]
        samples.append((noisy[valid], rgb8[valid], normals[valid], depth[valid] / scene.focal))
        views.append(
            View(
                f"photo_{index:02d}.png",
                rgb8.reshape(height, width, 3),
                depth.reshape(height, width),
                valid.reshape(height, width).astype(float),
                scene.K,
                (camera_from_gv @ invert_rigid(world_from_gv))[:3],
                (4 * width, 4 * height),
            )
        )
        labels.append(label.reshape(height, width))
    points_gv = _fuse(samples)
    rotation = world_from_gv[:3, :3]
    cloud = PointCloud(
        transform_points(world_from_gv, points_gv.xyz),
        points_gv.rgb,
        points_gv.normal @ rotation.T,
        points_gv.spacing,
        points_gv.confidence,
    )
    reconstruction = Reconstruction(
        tuple(views), cloud, cloud.xyz[:10], (), Scale("known_cameras"), "known"
    )
    gravity = GravityView(
        homogeneous(invert_rigid(world_from_gv)), views[0].photo, rotation[:, 1], 0.1, ()
    )
    return reconstruction, gravity, labels


def _fuse(samples: list[tuple[np.ndarray, ...]]) -> PointCloud:
    """Average all samples in cubes of the median pixel footprint."""
    xyz, rgb, normal, footprint = (np.concatenate(part) for part in zip(*samples, strict=True))
    cell = float(np.median(footprint))
    _, inverse = np.unique(np.floor(xyz / cell).astype(int), axis=0, return_inverse=True)
    inverse = inverse.ravel()
    count = np.bincount(inverse)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack(
            [np.bincount(inverse, values[:, k].astype(float)) / count for k in range(3)], 1
        )

    mean_normal = mean(normal)
    mean_normal /= np.maximum(np.linalg.norm(mean_normal, axis=1, keepdims=True), 1e-9)
    return PointCloud(
        mean(xyz),
        mean(rgb).astype(np.uint8),
        mean_normal,
        np.full(len(count), cell),
        np.minimum(count / 3.0, 1.0),
    )


def target_box(
    name: str, label: int, labels: list[np.ndarray], view: int, loose: float = 0.05
) -> Target:
    """Return a slightly loose box around a label in a view, in pixels of the photo file."""
    rows, columns = np.nonzero(labels[view] == label)
    x0, x1 = columns.min(), columns.max() + 1
    y0, y1 = rows.min(), rows.max() + 1
    dx, dy = loose * (x1 - x0), loose * (y1 - y0)
    height, width = labels[view].shape
    box = (max(x0 - dx, 0), max(y0 - dy, 0), min(x1 + dx, width), min(y1 + dy, height))
    return Target(name, f"photo_{view:02d}.png", tuple(4.0 * float(v) for v in box))


def table_with(objects: tuple[Solid, ...]) -> tuple[Solid, ...]:
    """Return a floor, two walls and a table whose top is y = 0, with objects on it."""
    return (
        Solid("box", (0, 0.85, 0), (4, 0.1, 4), (120, 100, 80), 90),
        Solid("box", (0, -0.5, 2.5), (4, 2, 0.1), (200, 195, 180), 91, frequency=15),
        Solid("box", (-2.5, -0.5, 0), (0.1, 2, 4), (190, 190, 200), 92, frequency=15),
        Solid("box", (0, 0.02, 0), (0.6, 0.02, 0.45), (140, 90, 60), 93),
        *objects,
    )
