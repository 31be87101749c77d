"""Move bodies apart that start inside each other or inside a support.

MuJoCo's own collision detection says where and how deep they overlap, so that what is clear
here is clear in the simulation. Bodies part horizontally, half each, so that both keep
standing on their supports; only a body that another body carries is raised.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float

from garden_models.geometry.rotation import quaternion_from_matrix
from garden_models.physics.config import Separation
from garden_models.physics.mjcf import is_free, write_mjcf
from garden_models.physics.mujoco_warnings import collect_warnings
from garden_models.scene import Body, SupportSurface

Vector3 = Float[np.ndarray, "3"]
UP_GV = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class Overlap:
    """A contact: ``normal`` points from body ``first`` to ``second`` (-1: a support)."""

    first: int
    second: int
    normal: Vector3
    depth: float


@collect_warnings()
def separate(
    bodies: tuple[Body, ...],
    supports: tuple[SupportSurface, ...],
    config: Separation = Separation(),
) -> tuple[Float[np.ndarray, "b 3"], float]:
    """Return how far each body has to move (GV, metres), and the overlap that is left.

    Fixed bodies do not move. The moves are found step by step, so that a body between two
    others finds its place or, where there is none, leaves an overlap.
    """
    moves = np.zeros((len(bodies), 3))
    if not bodies:
        return moves, 0.0
    mjcf = write_mjcf(bodies, supports, np.eye(3))
    model = mujoco.MjModel.from_xml_string(mjcf.xml, mjcf.asset_bytes)
    data = mujoco.MjData(model)
    deepest = 0.0
    for _ in range(config.steps):
        overlaps = _overlaps(model, data, bodies, moves)
        deepest = max((overlap.depth for overlap in overlaps), default=0.0)
        if deepest <= config.allowed_overlap_m:
            break
        moves += _resolve(overlaps, bodies, moves, config)
    return moves, deepest


def _overlaps(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    bodies: tuple[Body, ...],
    moves: Float[np.ndarray, "b 3"],
) -> list[Overlap]:
    """List the penetrating contacts of the bodies after their moves."""
    address = 0
    for body, move in zip(bodies, moves, strict=True):
        if is_free(body):
            position = body.gv_from_body[:3, 3] + move
            quaternion = quaternion_from_matrix(body.gv_from_body[:3, :3])
            data.qpos[address : address + 7] = np.concatenate([position, quaternion])
            address += 7
    mujoco.mj_fwdPosition(model, data)
    owner = {model.body(body.name).id: i for i, body in enumerate(bodies)}
    overlaps = []
    for contact in data.contact:
        if contact.dist < 0:
            first, second = (owner.get(int(model.geom_bodyid[g]), -1) for g in contact.geom)
            overlaps.append(Overlap(first, second, contact.frame[:3].copy(), -contact.dist))
    return overlaps


def _resolve(
    overlaps: list[Overlap],
    bodies: tuple[Body, ...],
    moves: Float[np.ndarray, "b 3"],
    config: Separation,
) -> Float[np.ndarray, "b 3"]:
    """Return one step of moves: per pair along the depth-weighted mean of its normals."""
    step = np.zeros((len(bodies), 3))
    for first, second in sorted({(o.first, o.second) for o in overlaps}):
        pair = [o for o in overlaps if (o.first, o.second) == (first, second)]
        depth = max(overlap.depth for overlap in pair)
        if depth <= config.allowed_overlap_m:
            continue
        normal = sum((o.normal * o.depth for o in pair), np.zeros(3))
        normal /= max(float(np.linalg.norm(normal)), 1e-12)
        free = [i >= 0 and is_free(bodies[i]) for i in (first, second)]
        if first < 0 or second < 0:
            body, away = (second, normal) if first < 0 else (first, -normal)
            if free[0] or free[1]:
                step[body] += (UP_GV if away @ UP_GV > 0.5 else away) * (depth + config.gap_m / 2)
            continue
        upper = _carried(bodies, first, second)
        if upper is not None:
            rise = depth / max(abs(float(normal @ UP_GV)), 0.5)
            step[upper] += UP_GV * (rise + config.gap_m / 2)
            continue
        sideways = _sideways(normal, bodies, moves, first, second)
        # The way out along ``sideways`` is longer than the depth along the normal.
        slant = max(abs(float(sideways @ normal)), 0.5)
        length = depth / slant + config.gap_m
        shares = {(True, True): (0.5, 0.5), (True, False): (1.0, 0.0), (False, True): (0.0, 1.0)}
        share = shares.get((free[0], free[1]), (0.0, 0.0))
        step[first] -= sideways * length * share[0]
        step[second] += sideways * length * share[1]
    return step


def _carried(bodies: tuple[Body, ...], first: int, second: int) -> int | None:
    """Return which of two bodies the other one carries, if any."""
    if bodies[first].supported_by == bodies[second].name:
        return first
    if bodies[second].supported_by == bodies[first].name:
        return second
    return None


def _sideways(
    normal: Vector3,
    bodies: tuple[Body, ...],
    moves: Float[np.ndarray, "b 3"],
    first: int,
    second: int,
) -> Vector3:
    """Return the horizontal direction from the first body to the second."""
    flat = normal - (normal @ UP_GV) * UP_GV
    if np.linalg.norm(flat) < 0.2:
        centres = [
            bodies[i].gv_from_body[:3, :3] @ bodies[i].centre_of_mass
            + bodies[i].gv_from_body[:3, 3]
            + moves[i]
            for i in (first, second)
        ]
        flat = centres[1] - centres[0]
        flat = flat - (flat @ UP_GV) * UP_GV
    length = float(np.linalg.norm(flat))
    return flat / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
