"""Losses of the Gravity-View decoder: L1 on rotation matrices, and honesty about the error."""

from __future__ import annotations

import torch
from torch import Tensor

from garden_models.gravity.decoder.network import DecodedRotation

SIGMA_WEIGHT = 0.02


def rotation_l1(found: Tensor, true: Tensor) -> Tensor:
    """Return the mean over a batch of ``||found - true||_1`` of rotations (paper, eq. 1)."""
    return (found - true).abs().sum(dim=(-2, -1)).mean()


def down_error(found: Tensor, true: Tensor) -> Tensor:
    """Return the angles (batch,) in radians between the gravity rows of two rotations."""
    a, b = found[..., 1, :], true[..., 1, :]
    return 2 * torch.atan2((a - b).norm(dim=-1), (a + b).norm(dim=-1))


def student_nll(log_sigma: Tensor, error: Tensor) -> Tensor:
    """Return the mean negative log likelihood of angular errors (radians) on a plane.

    The density is Student's with two degrees of freedom, so that one scene read wrongly does
    not decide how sure the network is of all others.
    """
    return (2 * log_sigma + 2 * torch.log1p(error.square() / (2 * (2 * log_sigma).exp()))).mean()


def decoder_loss(found: DecodedRotation, true: Tensor) -> Tensor:
    """Return the paper's loss; the uncertainty learns from the error without changing it."""
    loss = rotation_l1(found.rotation, true)
    if found.log_sigma is not None:
        error = down_error(found.rotation.detach(), true)
        loss = loss + SIGMA_WEIGHT * student_nll(found.log_sigma, error)
    return loss
