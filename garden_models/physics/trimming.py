"""Trim the colliders of bodies that touch, where both claim the same space within their noise.

Two reconstructed surfaces in contact overlap by their noise. Pushing the bodies apart for that
would move them away from where they were seen. What both claim, and what is thinner than their
noise, belongs to neither: each pair of overlapping convex pieces is cut back along the contact
normal, each by its share. What overlaps more than that is left for ``separate``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from garden_models.physics.config import Separation
from garden_models.physics.convex_pieces import hull_piece
from garden_models.physics.mjcf import write_mjcf
from garden_models.physics.mujoco_warnings import collect_warnings
from garden_models.scene import Body, ConvexPiece

ROUNDS = 4
"""Cutting one pair may change the deepest contact of another."""


@dataclass(frozen=True)
class _Contact:
    """Two pieces, as (body, piece), and how they overlap; ``normal`` is from first to second."""

    first: tuple[int, int]
    second: tuple[int, int]
    position_gv: Float[np.ndarray, "3"]
    normal_gv: Float[np.ndarray, "3"]
    depth: float


def deep_contacts_gv(
    bodies: tuple[Body, ...], allowed_m: Sequence[float]
) -> tuple[Float[np.ndarray, "n 3"], ...]:
    """Return, per body, where other bodies' pieces overlap its own by more than trimming mends.

    ``allowed_m`` is as for ``trim_overlaps``.
    """
    found: list[list[np.ndarray]] = [[] for _ in bodies]
    for contact in _contacts(bodies):
        i, j = contact.first[0], contact.second[0]
        if contact.depth > (allowed_m[i] + allowed_m[j]) / 2:
            found[i].append(contact.position_gv)
            found[j].append(contact.position_gv)
    return tuple(np.array(points).reshape(-1, 3) for points in found)


def trim_overlaps(
    bodies: tuple[Body, ...],
    allowed_m: Sequence[float],
    config: Separation = Separation(),
) -> tuple[tuple[Body, ...], Float[np.ndarray, " b"]]:
    """Return the bodies with trimmed colliders, and how much was cut off each at most (metres).

    ``allowed_m`` is how much may be cut off a piece of each body. Pieces keep more than half of
    their thickness; bodies do not move.
    """
    pieces = [list(body.colliders) for body in bodies]
    cut = [np.zeros(len(own)) for own in pieces]
    for _ in range(ROUNDS):
        trimmed = tuple(
            replace(body, colliders=tuple(own)) for body, own in zip(bodies, pieces, strict=True)
        )
        progress = False
        for contact in _contacts(trimmed):
            (i, a), (j, b) = contact.first, contact.second
            left = np.array([allowed_m[i] - cut[i][a], allowed_m[j] - cut[j][b]])
            need = contact.depth + config.gap_m
            if contact.depth <= config.allowed_overlap_m or left.min() < 0 or left.sum() < need:
                continue
            shares = need * left / left.sum()
            for (body, piece), share, sign in (((i, a), shares[0], 1.0), ((j, b), shares[1], -1.0)):
                normal = bodies[body].gv_from_body[:3, :3].T @ (sign * contact.normal_gv)
                shorter = _cut_back(pieces[body][piece], normal, float(share))
                if shorter is not None:
                    pieces[body][piece] = shorter
                    cut[body][piece] += share
                    progress = True
        if not progress:
            break
    trimmed = tuple(
        replace(body, colliders=tuple(own)) for body, own in zip(bodies, pieces, strict=True)
    )
    return trimmed, np.array([own.max(initial=0.0) for own in cut])


@collect_warnings()
def _contacts(bodies: tuple[Body, ...]) -> list[_Contact]:
    """Return the deepest contact of every pair of pieces of different bodies, deepest first."""
    mjcf = write_mjcf(bodies, (), np.eye(3))
    model = mujoco.MjModel.from_xml_string(mjcf.xml, mjcf.asset_bytes)
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    owner = {
        model.geom(f"{body.name}_collider_{k}").id: (i, k)
        for i, body in enumerate(bodies)
        for k in range(len(body.colliders))
    }
    deepest: dict[tuple[int, int], _Contact] = {}
    for contact in data.contact:
        pair = (int(contact.geom[0]), int(contact.geom[1]))
        if contact.dist < 0 and (pair not in deepest or -contact.dist > deepest[pair].depth):
            first, second = owner[pair[0]], owner[pair[1]]
            deepest[pair] = _Contact(
                first, second, contact.pos.copy(), contact.frame[:3].copy(), -contact.dist
            )
    return sorted(deepest.values(), key=lambda contact: -contact.depth)


def _cut_back(
    piece: ConvexPiece, normal: Float[np.ndarray, "3"], length: float
) -> ConvexPiece | None:
    """Cut ``length`` off the end of a piece that lies farthest along ``normal``.

    Returns None if less than half of the piece would be left in that direction.
    """
    along = piece.vertices @ normal
    limit = float(along.max()) - length
    if limit < (along.max() + along.min()) / 2:
        return None
    kept = piece.vertices[along <= limit]
    return hull_piece(np.concatenate([kept, _crossings(piece, along, limit)]), 0.0)


def _crossings(
    piece: ConvexPiece, along: Float[np.ndarray, " v"], limit: float
) -> Float[np.ndarray, "n 3"]:
    """Return where the edges of a convex piece pass the plane ``along == limit``."""
    faces: Int[np.ndarray, "f 3"] = piece.faces
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = edges[(along[edges[:, 0]] > limit) & (along[edges[:, 1]] <= limit)]
    outer, inner = along[edges[:, 0]], along[edges[:, 1]]
    share = ((limit - inner) / (outer - inner))[:, None]
    start = piece.vertices[edges[:, 1]]
    return start + share * (piece.vertices[edges[:, 0]] - start)
