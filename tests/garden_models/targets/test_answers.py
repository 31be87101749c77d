"""Whatever a model says, either targets come of it that can be used, or one sentence."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from garden_models.scene import BadInput, Photo
from garden_models.targets.answered_targets import clean_name, read_answer
from garden_models.targets.box_convention import CONVENTIONS, BoxConvention
from garden_models.targets.boxes import check_name, validate
from garden_models.targets.repeats import without_repeats
from garden_models.targets.shown_photos import shown_photos

SIZES = {"a.jpg": (400, 300), "b.jpg": (300, 400)}
PHOTOS = [
    Photo(name, np.zeros((size[1] // 2, size[0] // 2, 3), np.uint8), size)
    for name, size in SIZES.items()
]

anything = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-3, 2000) | st.text(max_size=9),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=9), inner),
    max_leaves=12,
)
number = st.integers(-50, 1100) | st.floats(-1, 1100) | st.text("0123456789.-", max_size=4)
entries = st.lists(
    st.fixed_dictionaries({
        "name": st.sampled_from(["mug", "Mug", "../x", "", "a b", "\0", "x" * 300]) | anything,
        "photo": st.sampled_from(["P1", "P2", "p1", 1, 2, 9, "b.jpg", "photo 2"]) | anything,
        "box_2d": st.lists(number, min_size=4, max_size=4) | anything,
    }),
    max_size=6,
)  # fmt: skip


def usable(text: str, convention: BoxConvention) -> None:
    """Read the answer; what comes of it must pass as boxes by hand do."""
    try:
        answer = read_answer(text, shown_photos(PHOTOS, 100, convention), convention)
    except BadInput as error:
        assert "\n" not in str(error)
        return
    kept, _notes = without_repeats(answer.targets)
    validate([one.target for one in kept], SIZES)


@given(value=anything | entries, convention=st.sampled_from(CONVENTIONS))
def test_any_json(value: Any, convention: BoxConvention) -> None:
    usable(json.dumps(value), convention)
    usable(json.dumps({"targets": value, "removed": value}), convention)


@given(value=entries, data=st.data())
def test_any_part_of_an_answer(value: Any, data: st.DataObject) -> None:
    text = json.dumps({"targets": value}, indent=data.draw(st.sampled_from([None, 1])))
    start = data.draw(st.integers(0, len(text)))
    usable(text[start : data.draw(st.integers(start, len(text)))], "yxyx_1000")


@given(st.text(st.sampled_from('[]{}",:0123456789. \n`jsonPbx_'), max_size=200))
def test_any_text(text: str) -> None:
    usable(text, "xyxy_1000")


def test_a_whole_entry_before_the_cut_is_never_lost() -> None:
    entry = {"name": "mug", "photo": "P1", "box_2d": [100, 100, 500, 500]}
    text = json.dumps({"targets": [entry, {**entry, "name": "jar"}, {**entry, "name": "pan"}]})
    for end in range(text.index("jar") - 12, len(text) + 1):
        answer = read_answer(text[:end], shown_photos(PHOTOS, 100, "yxyx_1000"), "yxyx_1000")
        whole = text[:end].count("500]}")
        assert len(answer.targets) == whole


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("red mug", "red_mug"),
        ("  Größe  ", "Größe"),
        ("../../etc/passwd", "etc_passwd"),
        (".hidden", "hidden"),
        ("a/b\\c\0d", "a_b_c_d"),
        ("-rf *", "rf"),
        ("", "object"),
        ("...", "object"),
        ("杯" * 100, "杯" * 48),
    ],
)
def test_names_become_safe(said: str, name: str) -> None:
    assert clean_name(said) == name


@given(st.text())
def test_every_name_becomes_safe(said: str) -> None:
    check_name(clean_name(said), "target")
