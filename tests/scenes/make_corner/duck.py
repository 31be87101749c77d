"""The decoy duck: a smooth union of ellipsoids, meshed by surface nets."""

from __future__ import annotations

import itertools

import numpy as np

from .noise import Array
from .shapes import Shape

# Parts, metres: centre (x forward, y left, z up), radii, pitch in degrees (nose up), and
# the width of the smooth blend with what came before.
PARTS: tuple[tuple[tuple[float, float, float], tuple[float, float, float], float, float], ...] = (
    ((0.000, 0.0, 0.048), (0.105, 0.062, 0.058), 0.0, 0.000),
    ((-0.096, 0.0, 0.078), (0.050, 0.032, 0.017), -30.0, 0.026),
    ((0.068, 0.0, 0.100), (0.032, 0.028, 0.045), -8.0, 0.026),
    ((0.078, 0.0, 0.146), (0.043, 0.036, 0.036), 0.0, 0.012),
    ((0.122, 0.0, 0.136), (0.026, 0.020, 0.009), -6.0, 0.006),
    ((-0.020, 0.050, 0.064), (0.068, 0.017, 0.032), -10.0, 0.004),
    ((-0.020, -0.050, 0.064), (0.068, 0.017, 0.032), -10.0, 0.004),
)


def part_distance(points: Array, part: int) -> Array:
    """Return the approximate signed distance, metres, of ``points`` to one part."""
    centre, radii, pitch_deg, _ = PARTS[part]
    c, s = np.cos(np.radians(pitch_deg)), np.sin(np.radians(pitch_deg))
    p = points - np.array(centre)
    local = np.stack([c * p[:, 0] + s * p[:, 2], p[:, 1], c * p[:, 2] - s * p[:, 0]], axis=1)
    scaled = np.linalg.norm(local / radii, axis=1)
    gradient = np.linalg.norm(local / np.square(radii), axis=1)
    return np.asarray(scaled * (scaled - 1.0) / np.maximum(gradient, 1e-9))


def distance(points: Array) -> Array:
    """Return the approximate signed distance of the duck before its base is cut flat."""
    total = part_distance(points, 0)
    for part in range(1, len(PARTS)):
        width = PARTS[part][3]
        other = part_distance(points, part)
        h = np.clip(0.5 + 0.5 * (total - other) / width, 0.0, 1.0)
        total = total * (1.0 - h) + other * h - width * h * (1.0 - h)
    return total


def duck(cell: float = 0.0042) -> Shape:
    """Return the duck as a closed mesh of about ``cell`` metres resolution."""
    low, high = np.array([-0.16, -0.08, -2.5 * cell]), np.array([0.16, 0.08, 0.20])
    counts = np.ceil((high - low) / cell).astype(int) + 1
    axes = [low[k] + cell * np.arange(counts[k]) for k in range(3)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    field = np.maximum(distance(grid.reshape(-1, 3)), -grid.reshape(-1, 3)[:, 2])
    shape = surface_nets(field.reshape(counts), axes)
    vertices = shape.vertices.copy()
    base = vertices[:, 2] < 0.6 * cell
    vertices[base, 2] = 0.0
    # Pull the net onto the true surface, base rim included (in its plane).
    for _ in range(4):
        value = distance(vertices)
        slope = np.stack(
            [(distance(vertices + e) - distance(vertices - e)) / 2e-5 for e in 1e-5 * np.eye(3)],
            axis=1,
        )
        slope[base, 2] = 0.0
        rim_only = base & (value < -0.5 * cell)
        push = value[:, None] * slope / np.maximum(np.sum(slope**2, axis=1), 0.05)[:, None]
        push[rim_only] = 0.0
        vertices -= np.clip(push, -cell, cell)
    return Shape(vertices, shape.faces, smooth=True)


def surface_nets(field: Array, axes: list[Array]) -> Shape:
    """Mesh the zero level of ``field`` (negative inside): one vertex a crossed cell."""
    inside = field < 0.0
    corner_count = np.zeros(tuple(n - 1 for n in field.shape), dtype=int)
    for corner in itertools.product((0, 1), repeat=3):
        corner_count += inside[
            tuple(slice(c, n - 1 + c) for c, n in zip(corner, field.shape, strict=True))
        ]
    crossed = (corner_count > 0) & (corner_count < 8)
    index = np.full(crossed.shape, -1)
    index[crossed] = np.arange(crossed.sum())

    sums = np.zeros((int(crossed.sum()), 3))
    counts = np.zeros(len(sums))
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        lower = tuple(slice(0, -1) if k == axis else slice(None) for k in range(3))
        upper = tuple(slice(1, None) if k == axis else slice(None) for k in range(3))
        edge = np.argwhere(inside[lower] != inside[upper])
        f0 = field[tuple(edge.T)]
        beyond = edge.copy()
        beyond[:, axis] += 1
        f1 = field[tuple(beyond.T)]
        point = np.stack([axes[k][edge[:, k]] for k in range(3)], axis=1)
        point[:, axis] += f0 / (f0 - f1) * (axes[axis][1] - axes[axis][0])
        around = []
        for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = edge.copy()
            cell[:, u] += du
            cell[:, v] += dv
            around.append(index[tuple(cell.T)])
        quad = np.stack(around, axis=1)
        for column in quad.T:
            np.add.at(sums, column, point)
            np.add.at(counts, column, 1.0)
        outward = f0 < 0.0
        quad = np.where(outward[:, None], quad, quad[:, ::-1])
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return Shape(sums / counts[:, None], np.concatenate(faces), smooth=True)
