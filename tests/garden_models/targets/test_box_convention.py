"""Boxes go into every model's way of counting and come back; each differs from the others."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from garden_models.targets.box_convention import (
    CONVENTIONS,
    PIXEL_RANGE,
    SIDE_MULTIPLE,
    BoxConvention,
    convention_of,
    photo_box,
    resized_by_model,
    written_box,
)

SENT, PHOTO = (800, 600), (4000, 3000)
BOX = (400.0, 600.0, 2000.0, 2700.0)


@pytest.mark.parametrize(
    ("convention", "written"),
    [
        ("yxyx_1000", [200, 100, 900, 500]),
        ("xyxy_1000", [100, 200, 500, 900]),
        ("xyxy_px", [80, 120, 400, 540]),
        ("xyxy_px_resized", [81, 118, 406, 529]),  # in 812 x 588
        ("xyxy_unit", [0.1, 0.2, 0.5, 0.9]),
    ],
)
def test_each_convention_writes_the_same_box_in_its_own_way(
    convention: BoxConvention, written: list[float]
) -> None:
    assert written_box(BOX, convention, SENT, PHOTO) == written


@pytest.mark.parametrize("convention", CONVENTIONS)
@given(
    corners=st.tuples(*[st.floats(0, 1) for _ in range(4)]),
    sent=st.tuples(st.integers(224, 1024), st.integers(224, 1024)),
)
def test_what_is_written_comes_back(
    convention: BoxConvention, corners: tuple[float, ...], sent: tuple[int, int]
) -> None:
    a, b, c, d = corners
    photo = (3 * sent[0], 2 * sent[1])
    box = (a * photo[0], b * photo[1], c * photo[0], d * photo[1])
    w0, w1, w2, w3 = written_box(box, convention, sent, photo)
    again = photo_box((w0, w1, w2, w3), convention, sent, photo)
    step = max(photo) / 200  # whole units, of which there are 224 at least
    assert again == pytest.approx(box, abs=step)


@pytest.mark.parametrize(
    ("model", "convention"),
    [
        ("gemini-3-flash-preview", "yxyx_1000"),
        ("google/gemma-4-27b-it", "yxyx_1000"),
        ("Qwen/Qwen3-VL-8B-Instruct", "xyxy_1000"),
        ("qwen3-vl:8b", "xyxy_1000"),
        ("Qwen3.5-27B", "xyxy_1000"),
        ("Qwen/Qwen2.5-VL-7B-Instruct", "xyxy_px_resized"),
        ("qwen2.5vl:7b", "xyxy_px_resized"),
        ("Qwen/Qwen2-VL-7B-Instruct", "xyxy_1000"),
        ("qwen-vl-max", None),
        ("gpt-9", None),
    ],
)
def test_families_of_models_are_known_by_name(model: str, convention: BoxConvention | None) -> None:
    assert convention_of(model) == convention


@given(st.tuples(st.integers(1, 9000), st.integers(1, 9000)))
def test_resized_sides_are_what_the_model_takes(sent: tuple[int, int]) -> None:
    width, height = resized_by_model(sent)
    assert width % SIDE_MULTIPLE == height % SIDE_MULTIPLE == 0
    assert min(width, height) >= SIDE_MULTIPLE
    if max(sent) < 20 * min(sent):
        assert PIXEL_RANGE[0] <= width * height <= PIXEL_RANGE[1]
        assert resized_by_model((width, height)) == (width, height)
