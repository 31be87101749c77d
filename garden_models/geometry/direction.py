"""Directions and axes on the unit sphere: grids, quadratic forms and their uncertainty.

An uncertain axis is written as a quadratic form ``M`` (3x3, symmetric, 1/rad^2): the
likelihood of the unit vector ``g`` is ``exp(-g' M g / 2)`` (a Bingham distribution). A pole
(gravity is near ``n``), a girdle (gravity is perpendicular to ``n``) and every sum of such
observations have this form; the best axis is the eigenvector of the least eigenvalue, and
the gaps to the other two eigenvalues are the inverse variances of its two tilts.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.special import ive

from garden_models.geometry.rotation import normalized

Form = Float[np.ndarray, "3 3"]
Direction = Float[np.ndarray, "3"]

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
NODES, NODE_WEIGHTS = np.polynomial.legendre.leggauss(64)


def hemisphere(count: int) -> Float[np.ndarray, "count 3"]:
    """Return ``count`` axes spread evenly over the half sphere z > 0 (Fibonacci lattice)."""
    z = (np.arange(count) + 0.5) / count
    angle = GOLDEN_ANGLE * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def axis_angle_deg(a: Direction, b: Direction) -> float:
    """Return the angle between two axes (directions up to sign), 0 to 90 degrees."""
    a, b = normalized(a), normalized(b)
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b))))


def pole_form(axis: Direction, sigma_rad: float) -> Form:
    """Return the form of "near ``axis``, give or take ``sigma_rad`` in each tilt"."""
    return (np.eye(3) - np.outer(axis, axis)) / sigma_rad**2


def girdle_form(normal: Direction, sigma_rad: float) -> Form:
    """Return the form of "perpendicular to ``normal``, give or take ``sigma_rad``"."""
    return np.outer(normal, normal) / sigma_rad**2


def least_axis(form: Form) -> tuple[Direction, Float[np.ndarray, "2"], Float[np.ndarray, "2 3"]]:
    """Return the best axis of a form, the sigmas of its tilts (rad) and their directions.

    The worse determined tilt comes first; a tilt that nothing determines has sigma pi / 2.
    """
    values, vectors = np.linalg.eigh(form)
    gaps = np.maximum(values[1:] - values[0], (2 / np.pi) ** 2)
    return vectors[:, 0], 1 / np.sqrt(gaps), vectors[:, 1:].T


def total_sigma_deg(form: Form) -> float:
    """Return the root mean square angular error (degrees) that a form expects of its axis."""
    _, sigmas, _ = least_axis(form)
    return float(min(np.degrees(np.linalg.norm(sigmas)), 90.0))


def add_covariance(form: Form, covariance: Form) -> Form:
    """Return the form of the same axis with an independent tilt error added (rad^2)."""
    _, sigmas, tilts = least_axis(form)
    combined = np.diag(sigmas**2) + tilts @ covariance @ tilts.T
    return tilts.T @ np.linalg.inv(combined) @ tilts


def soften(form: Form, sigma_rad: float) -> Form:
    """Return the form with an independent error of ``sigma_rad`` added to both tilts."""
    return add_covariance(form, sigma_rad**2 * np.eye(3))


def log_density(form: Form, axes: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
    """Return the log of a form's density at unit ``axes``, relative to the uniform density.

    The normalising constant is the exact integral over the sphere (one dimension in closed
    form, the other by Gauss quadrature).
    """
    values = np.linalg.eigvalsh(form)
    small, large = values[1] - values[0], values[2] - values[0]
    reach = min(1.0, 9.0 / np.sqrt(large)) if large > 0 else 1.0
    x = (NODES + 1) / 2 * reach
    integrand = np.exp(-0.5 * large * x * x) * ive(0, small * (1 - x * x) / 4)
    constant = float((NODE_WEIGHTS @ integrand) * reach / 2)
    quadratic = np.einsum("ni,ij,nj->n", axes, form, axes) - values[0]
    return -0.5 * quadratic - np.log(constant)
