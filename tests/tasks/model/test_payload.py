"""What goes to a worker and back: whole, or refused."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from tasks.model_worker.payload import TREE, BadPayload, read_payload, write_payload
from tests.tasks.model.nouns import Answer, Part


@dataclass(frozen=True)
class Everything:
    array: np.ndarray
    numbers: tuple[float, ...]
    texts: dict[str, str]
    data: bytes
    maybe: Part | None
    whole: int
    yes: bool


ARRAYS = arrays.arrays(
    st.sampled_from(["|u1", "<f4", "<f8", "<i8", "|b1", ">f4"]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)
VALUES = st.builds(
    Everything,
    array=ARRAYS,
    numbers=st.lists(st.floats()).map(tuple),
    texts=st.dictionaries(st.text(), st.text(max_size=5) | st.just("long " * 2000)),
    data=st.binary(),
    maybe=st.none() | st.builds(Part, st.just(np.eye(4)), st.text()),
    whole=st.integers(),
    yes=st.booleans(),
)


def same(a: Any, b: Any) -> bool:
    if dataclasses.is_dataclass(a):
        return type(a) is type(b) and all(
            same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a)
        )
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and (a == b or repr(a) == repr(b) == "nan")


@settings(max_examples=60, deadline=None)
@given(value=VALUES)
def test_what_is_written_is_read(
    value: Everything, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("payload") / "p"
    assert same(read_payload(folder, write_payload(value, folder), Everything), value)


def written(folder: Path) -> str:
    return write_payload(Answer(np.ones((2, 2)), 0.5, (Part(np.eye(4), "a note"),)), folder)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_no_flipped_bit_is_taken_for_an_answer(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.mktemp("payload") / "p"
    digest = written(folder)
    file = data.draw(st.sampled_from(sorted(folder.iterdir())))
    content = bytearray(file.read_bytes())
    bit = data.draw(st.integers(0, 8 * len(content) - 1))
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)
    with pytest.raises(BadPayload):
        read_payload(folder, digest, Answer)


@pytest.mark.parametrize(
    "damage",
    [
        lambda file: file.unlink(),
        lambda file: file.write_bytes(file.read_bytes()[:-1]),
        lambda file: file.write_bytes(file.read_bytes() + b"x"),
    ],
)
def test_missing_and_cut_files_are_found(tmp_path: Path, damage: Callable[[Path], object]) -> None:
    for number, name in enumerate([TREE, "0000.npy", "0001.npy"]):
        folder = tmp_path / str(number)
        digest = written(folder)
        damage(folder / name)
        with pytest.raises(BadPayload, match=name):
            read_payload(folder, digest, Answer)


def test_another_noun_is_refused(tmp_path: Path) -> None:
    digest = written(tmp_path / "p")
    with pytest.raises(BadPayload, match="stored value is a Answer, expected Part"):
        read_payload(tmp_path / "p", digest, Part)


def test_nothing_unpickles(tmp_path: Path) -> None:
    with pytest.raises(BadPayload, match="arrays of object cannot be stored"):
        write_payload(Part(np.array([print], dtype=object)), tmp_path / "p")
    with pytest.raises(BadPayload, match="is a object: store dataclasses"):
        write_payload(Part(np.eye(4), object()), tmp_path / "q")  # type: ignore[arg-type]


def test_the_tree_says_what_each_member_is(tmp_path: Path) -> None:
    written(tmp_path / "p")
    document = json.loads((tmp_path / "p" / TREE).read_text())
    assert document["leaves"] == {"parts/0/pose": "0001.npy", "values": "0000.npy"}
    assert [size for size, _digest in document["members"].values()] == [160, 256]
