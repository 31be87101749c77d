"""Write points and 3D Gaussians as binary PLY."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, UInt8

SH_C0 = 0.28209479177387814
"""Zeroth spherical-harmonics basis: colour = 0.5 + SH_C0 * f_dc."""


def points_ply(
    xyz: Float[np.ndarray, "n 3"],
    rgb: UInt8[np.ndarray, "n 3"],
    normal: Float[np.ndarray, "n 3"] | None = None,
) -> bytes:
    """Return a binary little-endian PLY of coloured points."""
    columns: dict[str, tuple[str, np.ndarray]] = {
        axis: ("<f4", xyz[:, i]) for i, axis in enumerate("xyz")
    }
    if normal is not None:
        columns |= {f"n{axis}": ("<f4", normal[:, i]) for i, axis in enumerate("xyz")}
    columns |= {c: ("u1", rgb[:, i]) for i, c in enumerate(("red", "green", "blue"))}
    return _binary_ply(columns)


def gaussians_ply(
    means: Float[np.ndarray, "n 3"],
    scales: Float[np.ndarray, "n 3"],
    quaternions_wxyz: Float[np.ndarray, "n 4"],
    opacities: Float[np.ndarray, " n"],
    rgb: UInt8[np.ndarray, "n 3"],
) -> bytes:
    """Return a 3DGS PLY: log scales (of ``scales`` in metres), logit opacities, degree 0."""
    columns: dict[str, tuple[str, np.ndarray]] = {
        axis: ("<f4", means[:, i]) for i, axis in enumerate("xyz")
    }
    columns |= {f"n{axis}": ("<f4", np.zeros(len(means))) for axis in "xyz"}
    dc = (rgb.astype(np.float64) / 255 - 0.5) / SH_C0
    columns |= {f"f_dc_{i}": ("<f4", dc[:, i]) for i in range(3)}
    columns["opacity"] = ("<f4", np.log(opacities / (1 - opacities)))
    columns |= {f"scale_{i}": ("<f4", np.log(scales[:, i])) for i in range(3)}
    columns |= {f"rot_{i}": ("<f4", quaternions_wxyz[:, i]) for i in range(4)}
    return _binary_ply(columns)


def _binary_ply(columns: dict[str, tuple[str, np.ndarray]]) -> bytes:
    names = {"<f4": "float", "u1": "uchar"}
    count = len(next(iter(columns.values()))[1])
    table = np.empty(count, dtype=[(name, kind) for name, (kind, _) in columns.items()])
    for name, (_, values) in columns.items():
        table[name] = values
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property {names[kind]} {name}" for name, (kind, _) in columns.items()]
    return ("\n".join([*header, "end_header"]) + "\n").encode() + table.tobytes()
