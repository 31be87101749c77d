"""Specks go, pinholes close, and what points confirm stays."""

from __future__ import annotations

import numpy as np
import pytest

from garden_models.segmentation.tidy import tidy_mask

NOTHING = np.zeros((60, 80), bool)


def with_rectangle(mask, rows, columns, value=True):
    out = mask.copy()
    out[slice(*rows), slice(*columns)] = value
    return out


BODY = with_rectangle(NOTHING, (10, 50), (10, 50))


def test_a_clean_mask_stays_as_it_is():
    np.testing.assert_array_equal(tidy_mask(BODY, BODY), BODY)


def test_an_empty_mask_stays_empty():
    assert not tidy_mask(NOTHING, BODY).any()


def test_a_part_that_no_point_confirms_is_dropped():
    stray = with_rectangle(BODY, (20, 40), (60, 78))
    np.testing.assert_array_equal(tidy_mask(stray, BODY), BODY)


def test_a_part_that_a_point_confirms_stays():
    apart = with_rectangle(BODY, (20, 40), (60, 78))
    evident = with_rectangle(BODY, (30, 31), (70, 71))
    np.testing.assert_array_equal(tidy_mask(apart, evident), apart)


def test_a_speck_goes_unless_it_is_made_of_points():
    speck = with_rectangle(BODY, (30, 33), (60, 63))
    touched = with_rectangle(BODY, (30, 31), (60, 61))
    np.testing.assert_array_equal(tidy_mask(speck, touched), BODY)
    np.testing.assert_array_equal(tidy_mask(speck, speck), speck)


def test_the_largest_part_stays_even_without_points():
    np.testing.assert_array_equal(tidy_mask(BODY, NOTHING), BODY)


def test_a_pinhole_is_filled_and_a_handle_stays_open():
    pinhole = with_rectangle(BODY, (30, 31), (30, 32), False)
    np.testing.assert_array_equal(tidy_mask(pinhole, pinhole), BODY)
    handle = with_rectangle(BODY, (25, 31), (25, 31), False)
    np.testing.assert_array_equal(tidy_mask(handle, handle), handle)


def test_a_gap_at_the_pictures_border_is_no_hole():
    full = ~NOTHING
    notched = with_rectangle(full, (0, 1), (40, 42), False)
    np.testing.assert_array_equal(tidy_mask(notched, notched), notched)


@pytest.mark.parametrize("seed", range(5))
def test_tidying_twice_changes_nothing_more(seed):
    rng = np.random.default_rng(seed)
    mask = np.kron(rng.random((15, 20)) < 0.55, np.ones((4, 4))).astype(bool)
    mask ^= rng.random(mask.shape) < 0.02
    evident = mask & (rng.random(mask.shape) < 0.05)
    once = tidy_mask(mask, evident)
    assert once.any()
    np.testing.assert_array_equal(tidy_mask(once, evident), once)
