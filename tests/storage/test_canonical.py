"""The canonical encoding: one value one encoding, two values two."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from storage.canonical import UNKEYED, canonical
from storage.digest import digest_value
from storage.errors import Unstorable


def encode(value: object) -> bytes:
    return canonical(value, domain="test/1")


@dataclass(frozen=True)
class Config:
    a: int = 1
    place: str = field(default="", metadata={UNKEYED: True})


@dataclass(frozen=True)
class Other:
    a: int = 1


DISTINCT: list[Any] = [
    None, True, False, 0, 1, -1, 1.0, 0.0, -0.0, "1", "", b"1", b"", (), [], {}, (1,), [1], (1, 2),
    ((1,), 2), (1, (2,)), ("a", "b"), ("a\tb",), ("ab",), ("a", "", "b"), {"a": 1}, {"a": 1.0},
    {"a": {"b": 1}}, {"a": 1, "b": 2}, Config(), Config(2), Other(), float("inf"), 10**30,
    np.zeros(2), np.zeros(2, np.float32), np.zeros((2, 1)), np.zeros((1, 2)), np.zeros(0),
    np.zeros((0, 3)), np.zeros(2, bool),
]  # fmt: skip


def test_different_values_never_encode_alike() -> None:
    encodings = [encode(value) for value in DISTINCT]
    for (i, a), (j, b) in combinations(enumerate(encodings), 2):
        assert a != b, (DISTINCT[i], DISTINCT[j])


json_like = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=4)
    | st.binary(max_size=4),
    lambda inner: st.lists(inner, max_size=3)
    | st.lists(inner, max_size=3).map(tuple)
    | st.dictionaries(st.text(max_size=2), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


@given(json_like, json_like)
def test_encoding_is_injective(a: object, b: object) -> None:
    assert (encode(a) == encode(b)) == (_shown(a) == _shown(b))


def _shown(value: object) -> str:
    """Return a text that differs exactly where values differ (dicts in order of key)."""
    if isinstance(value, dict):
        return "{" + ",".join(f"{k!r}:{_shown(value[k])}" for k in sorted(value)) + "}"
    if isinstance(value, tuple | list):
        return type(value).__name__ + "(" + ",".join(_shown(item) for item in value) + ")"
    return repr(value)


def test_equal_values_encode_alike() -> None:
    assert encode({"a": 1, "b": 2}) == encode({"b": 2, "a": 1})
    assert encode(np.float64(1.5)) == encode(1.5)
    assert encode(np.int8(3)) == encode(3)
    assert encode(np.bool_(True)) == encode(True)
    assert encode(Config(place="here")) == encode(Config(place="there"))
    ordered = np.arange(6.0).reshape(2, 3)
    assert encode(np.asfortranarray(ordered)) == encode(ordered)
    assert encode(ordered.astype(">f8")) == encode(ordered)


def test_domains_never_collide() -> None:
    assert canonical(1, domain="a") != canonical(1, domain="b")


@pytest.mark.parametrize(
    ("value", "word"),
    [
        ({"a": {1, 2}}, "value.a is a set"),
        ((Path("x"),), r"value\[0\] is a path"),
        ({"a": float("nan")}, "value.a is NaN"),
        ({1: 2}, "the key 1"),
        (object(), "value is a object"),
        (np.array(["a"]), "arrays of"),
    ],
)
def test_what_has_no_canonical_form_is_named(value: object, word: str) -> None:
    with pytest.raises(Unstorable, match=word):
        encode(value)


def test_nan_is_one_value_where_it_is_allowed() -> None:
    nan = canonical(float("nan"), domain="d", nan="allow")
    assert nan == canonical(-float("nan"), domain="d", nan="allow")


def test_digest_does_not_depend_on_the_hash_seed() -> None:
    code = (
        "from storage.digest import digest_value;"
        "print(digest_value({'b': (1, 2.5, None), 'a': [True, 'x']}, domain='d'))"
    )
    digests = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
        for seed in ("0", "1")
    }
    assert digests == {digest_value({"a": [True, "x"], "b": (1, 2.5, None)}, domain="d")}
