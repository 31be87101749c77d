"""The codec: every kind of field comes back as it was, however it is laid out."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from storage import SchemaMismatch, Store, Unstorable
from storage.canonical import UNKEYED
from storage.codec.content import content_digest
from tests.storage.media import behind, on_any_medium
from tests.storage.samples import Scale, Scene, View, same, scene


@on_any_medium
def test_every_kind_of_field_comes_back(store: Store) -> None:
    table = pa.table({"name": ["a", None], "value": [1.5, 2.5]})
    value = dataclasses.replace(scene(), table=table, best=np.array(3.0))
    again = store.read(store.publish(value).object, Scene)
    assert again.table.equals(table)
    assert same(dataclasses.replace(value, table=None), dataclasses.replace(again, table=None))


@on_any_medium
@pytest.mark.parametrize("views", [0, 1, 2, 5])
def test_ragged_and_empty_tuples_come_back(store: Store, views: int) -> None:
    value = scene(views=views)
    assert same(value, store.read(store.publish(value).object, Scene))


@on_any_medium
@pytest.mark.parametrize(
    "array",
    [
        np.zeros((0, 3), np.float32),
        np.zeros((3, 0)),
        np.zeros(()),
        np.array(True),
        np.zeros((5, 7), bool),
        np.full((3, 3), np.nan),
        np.arange(5, dtype=">i4").astype("<i4"),
        np.arange(400_000, dtype=np.int64).reshape(-1, 4),
        np.zeros((3, 600, 700), np.float32),
        np.ones((2, 3), np.complex64),
        np.arange(6, dtype=np.float16),
    ],
    ids=lambda a: f"{a.dtype}{a.shape}",
)
def test_arrays_come_back_bit_for_bit(store: Store, array: np.ndarray) -> None:
    value = dataclasses.replace(scene(), points=array, masks=(array, array))
    again = store.read(store.publish(value).object, Scene)
    assert same(again.points, array)
    assert same(again.masks, (array, array))
    assert again.points.flags.writeable


@on_any_medium
@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.lists(
        hnp.arrays(
            st.sampled_from([np.uint8, np.float32, np.float64, np.int64, np.bool_]),
            hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
        ),
        max_size=4,
    )
)
def test_any_mix_of_arrays_comes_back(store: Store, arrays: list[np.ndarray]) -> None:
    value = dataclasses.replace(scene(views=0), masks=tuple(arrays))
    assert same(store.read(store.publish(value).object, Scene).masks, tuple(arrays))


@on_any_medium
def test_masks_of_views_share_few_files(store: Store) -> None:
    few = store.manifest(store.publish(scene(views=2)).object).members
    many = store.manifest(store.publish(scene(views=20)).object).members
    assert len(many) == len(few)


@on_any_medium
def test_single_fields_and_slices_are_read_alone(store: Store) -> None:
    value = scene(views=4)
    digest = store.publish(value).object
    fields = store.read_fields(digest, Scene, ("scale", "notes"))
    assert fields == {"scale": Scale("prior", 2.5), "notes": ("one", "")}
    array, place = store.read_array(digest, "views/2/rgb")
    assert same(np.asarray(array[place[0]]), value.views[2].rgb)


@on_any_medium
def test_plain_values_are_objects_too(store: Store) -> None:
    for value in ("text", "long " * 5000, b"bytes", {"a": [1, 2.0, None]}, (1, "x")):
        assert store.read_as(store.publish(value).object, type(value)) == value


def test_an_object_is_a_zarr_group(store: Store) -> None:
    import zarr

    value = scene()
    folder = store.folder(store.publish(value).object)
    group: Any = zarr.open_group(folder, mode="r")
    assert group["views/rgb"].shape == (3, 3, 4, 3)
    assert json.loads((folder / "zarr.json").read_text())["attributes"]["garden"]["kind"] == "Scene"


@dataclass(frozen=True)
class Elsewhere:
    views: int = 0


@on_any_medium
def test_reading_as_something_else_is_refused(store: Store) -> None:
    digest = store.publish(scene()).object
    with pytest.raises(SchemaMismatch, match="is a Scene"):
        store.read(digest, Elsewhere)
    with pytest.raises(SchemaMismatch, match="no field 'nothing'"):
        store.read_fields(digest, Scene, ("nothing",))


@on_any_medium
@pytest.mark.parametrize(
    ("value", "where"),
    [
        (dataclasses.replace(scene(), table={1, 2}), "table is a set"),
        (dataclasses.replace(scene(), scores={1: 2.0}), "keys must be str"),
        (dataclasses.replace(scene(), points=np.array([object()])), "object"),
        (dataclasses.replace(scene(), table=Path("x")), "table is a PosixPath"),
    ],
)
def test_what_cannot_be_stored_is_named_and_leaves_nothing(
    store: Store, value: Scene, where: str
) -> None:
    with pytest.raises(Unstorable, match=where):
        store.publish(value)
    assert list(store.objects()) == []
    assert behind(store).names("objects/") + behind(store).names("tmp/") == []


def test_content_does_not_depend_on_memory_layout_or_insertion_order() -> None:
    value = scene()
    twisted = dataclasses.replace(
        value,
        points=np.asfortranarray(value.points.astype(">f4")),
        scores=dict(reversed(value.scores.items())),
    )
    assert content_digest(value) == content_digest(twisted)


def test_content_tells_values_apart() -> None:
    base = scene()
    others = [
        scene(1),
        dataclasses.replace(base, points=base.points.astype(np.float64)),
        dataclasses.replace(base, points=base.points.reshape(3, 17)),
        dataclasses.replace(base, scale=None),
        dataclasses.replace(base, counts={"a": 1, "b/c d": 3}),
        dataclasses.replace(base, report=base.report + "y"),
        dataclasses.replace(base, blob=b""),
        dataclasses.replace(base, masks=base.masks[::-1]),
    ]
    assert len({content_digest(value) for value in [base, *others]}) == len(others) + 1


def test_content_of_a_table_does_not_depend_on_chunks_or_column_order() -> None:
    whole = pa.table({"a": [1, 2, 3], "b": ["x", "y", None]})
    parts = pa.concat_tables([whole.slice(0, 1), whole.slice(1)]).select(["b", "a"])
    assert content_digest(whole) == content_digest(parts)
    assert content_digest(whole) != content_digest(whole.slice(1))


def golden_values() -> dict[str, Any]:
    view = View("a.jpg", np.arange(36, dtype=np.uint8).reshape(3, 4, 3), np.eye(3))
    return {
        "text": "garden",
        "tuple": (1, 1.0, True, None, float("inf")),
        "array": np.arange(6, dtype=np.float32).reshape(2, 3),
        "view": view,
        "table": pa.table({"a": [1, 2], "b": ["x", "y"]}),
        "bytes": b"\x00\xff",
    }


def test_golden_content_digests() -> None:
    """A change here makes every store of every user run again: raise the format instead."""
    expected = json.loads((Path(__file__).parent / "golden_digests.json").read_text())
    assert {name: content_digest(v) for name, v in golden_values().items()} == expected


def test_importing_storage_is_quick_and_loads_no_format_library() -> None:
    code = (
        "import sys, time; t = time.perf_counter(); import storage; "
        "print([m for m in ('zarr', 'pyarrow', 'numpy', 'prefect') if m in sys.modules])"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


@dataclass(frozen=True)
class Timed:
    value: np.ndarray
    seconds: float = field(default=0.0, metadata={UNKEYED: True})
    log: str = field(default="", metadata={UNKEYED: True})


@dataclass(frozen=True)
class Runs:
    runs: tuple[Timed, ...]
    by_name: dict[str, Timed]


def runs(seconds: float, value: float = 1.0) -> Runs:
    timed = Timed(np.array([value]), seconds, f"{seconds}" * 5000)
    return Runs((timed,), {"$leaf": timed, "$type": timed})


def test_same_as_cold_what_does_not_count_comes_back_but_is_not_content(store: Store) -> None:
    """A step that notes how long something took gives equal results twice."""
    first, second = store.publish(runs(1.0)), store.publish(runs(2.0))
    assert first.content == second.content
    assert first.object != second.object
    again = store.read(second.object, Runs)
    assert again.runs[0].seconds == again.by_name["$type"].seconds == 2.0
    assert again.runs[0].log == "2.0" * 5000
    assert store.read_fields(store.publish(again.runs[0]).object, Timed, ("seconds",)) == {
        "seconds": 2.0
    }
    assert store.publish(runs(1.0, value=3.0)).content != first.content
