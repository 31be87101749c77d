from __future__ import annotations

import numpy as np
import pytest

from garden_models.meshing.field import keep_solid, solve_field


def test_strong_evidence_is_kept() -> None:
    target = np.linspace(-1, 1, 20)[:, None, None] * np.ones((1, 12, 12))
    solved = solve_field(target, np.ones_like(target), stiffness=0.01)
    np.testing.assert_allclose(solved[1:-1], target[1:-1], atol=0.01)


def test_a_gap_between_two_plates_is_bridged_smoothly() -> None:
    target = np.zeros((9, 9, 9))
    weight = np.zeros_like(target)
    target[0], target[-1] = -1.0, 1.0
    weight[0] = weight[-1] = 1e6
    solved = solve_field(target, weight, stiffness=1.0, steps=600)
    np.testing.assert_allclose(solved[:, 4, 4], np.linspace(-1, 1, 9), atol=0.02)


def test_small_pieces_go_and_cavities_are_filled() -> None:
    field = np.ones((20, 20, 20))
    field[2:14, 2:14, 2:14] = -1.0
    field[6:9, 6:9, 6:9] = 1.0
    field[17, 17, 17] = -1.0
    solid, pieces = keep_solid(field, 0.05)
    assert pieces == 1
    assert (solid[2:14, 2:14, 2:14] < 0).all()
    assert solid[17, 17, 17] > 0
    assert (solid < 0).sum() == 12**3


def test_two_large_pieces_are_both_kept() -> None:
    field = np.ones((20, 10, 10))
    field[1:8, 1:9, 1:9] = field[11:19, 1:9, 1:9] = -1.0
    assert keep_solid(field, 0.05)[1] == 2


@pytest.mark.parametrize("shape", [(4, 5, 6)])
def test_nothing_solid_is_no_piece(shape: tuple[int, int, int]) -> None:
    assert keep_solid(np.ones(shape), 0.05)[1] == 0
