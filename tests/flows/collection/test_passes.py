"""A collection loads each model once for a wave of scenes, and repeats no work for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest

from flows.collection import passes, run
from flows.collection.job import JobOrder
from flows.collection.overview import model_lines
from flows.collection.page import collection_page
from flows.collection.passes import postponed, priority, stops_of
from flows.collection.row import SceneRow
from flows.collection.state import CollectionState, read_state
from flows.command.status import _lines
from flows.preset import Preset
from garden_models import foundation
from storage import Store
from tasks.step import Step
from tests.flows.collection.model_job import STOPS, orders
from tests.flows.collection.test_run import batch, rows_of
from tests.tasks.model.doubler import loads, put_weights
from tests.tasks.model.registered import register_for

SCENES = dict.fromkeys("abcdef", "")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    Store.open(tmp_path / "store")
    register_for(monkeypatch)
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GARDEN_KEEPER", raising=False)
    put_weights(tmp_path / "weights/doubler", 2.0)
    put_weights(tmp_path / "weights/tripler", 3.0)
    yield tmp_path


def loaded(home: Path) -> tuple[int, int]:
    return loads(home / "weights/doubler"), loads(home / "weights/tripler")


def ran(home: Path) -> list[str]:
    return (home / "ran.log").read_text().splitlines()


def state_of(home: Path) -> CollectionState:
    state = read_state(home / "out")
    assert state is not None
    return state


def test_each_model_is_loaded_once_and_each_step_runs_once(home: Path) -> None:
    result = batch(home, orders(home, **SCENES))
    assert result.status == "ok"
    assert loaded(home) == (1, 1)
    lines = ran(home)
    assert len(lines) == len(set(lines)) == 4 * len(SCENES)
    first_finished = next(i for i, line in enumerate(lines) if line.startswith("triple"))
    assert sum(line.startswith("double") for line in lines[:first_finished]) >= len(SCENES) - 1
    for row in result.rows:
        assert (row.status, row.executed, row.cached) == ("ok", 4, 0)
        assert row.seconds > 0
    costs = state_of(home).models
    assert [(c["loads"], c["calls"]) for c in costs.values()] == [(1, 6), (1, 12)]


@pytest.mark.slow
def test_who_reads_the_state_is_told_of_the_models(home: Path) -> None:
    batch(home, orders(home, a="", b=""))
    state = state_of(home)
    line = next(line for line in model_lines(state) if line.startswith("doubler"))
    assert line.startswith("doubler: loaded once in ")
    assert "asked 2 times in " in line
    assert line in collection_page(state)
    assert line in _lines(state)


@pytest.mark.slow
def test_in_waves_the_first_scenes_finish_before_the_last_ones_begin(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(passes, "WAVE", 3)
    assert batch(home, orders(home, **SCENES), scenes_at_once=1).status == "ok"
    lines = ran(home)
    assert lines.index("finish c") < lines.index("double d")
    assert loaded(home) == (2, 2)


@pytest.mark.slow
def test_a_scene_that_fails_leaves_the_others_alone(home: Path) -> None:
    result = batch(home, orders(home, a="fails early", b="", c="fails late", d=""))
    rows = rows_of(result)
    assert {name: row.status for name, row in rows.items()} == {
        "a": "failed", "b": "ok", "c": "failed", "d": "ok",
    }  # fmt: skip
    assert rows["c"].reasons == ["the last step of this scene went wrong"]
    assert rows["a"].executed == 1
    assert rows["c"].executed == 4


@pytest.mark.slow
def test_a_rerun_starts_no_keeper_and_loads_nothing(home: Path) -> None:
    scenes = orders(home, **SCENES)
    batch(home, scenes)
    again = batch(home, scenes)
    assert [(row.executed, row.cached) for row in again.rows] == [(0, 4)] * len(SCENES)
    assert loaded(home) == (1, 1)


@pytest.mark.slow
def test_what_is_in_the_store_is_not_waited_for(home: Path) -> None:
    """Only a step that has to run ends a pass."""
    batch(home, orders(home, a="", b=""))
    (home / "ran.log").unlink()
    put_weights(home / "weights/doubler", 7.0)
    result = batch(home, orders(home, a="", b="", c=""))
    assert result.status == "ok"
    assert sorted(ran(home))[:3] == ["double a", "double b", "double c"]


@pytest.mark.slow
def test_a_batch_that_is_stopped_between_two_passes_goes_on_from_there(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(event: run.RowEvent) -> None:
        if "triple a 1" in ran(home) if (home / "ran.log").exists() else False:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(home, orders(home, **SCENES), on_event=stop)
    assert state_of(home).phase == "stopped"
    before = ran(home)
    assert batch(home, orders(home, **SCENES)).status == "ok"
    lines = ran(home)
    doubled = [line for line in lines if line.startswith("double")]
    assert len(doubled) == len(set(doubled)) == len(SCENES), before


@dataclass(frozen=True)
class Options:
    method: str = "ours"
    methods: tuple[str, ...] = ()


@dataclass(frozen=True)
class Chosen:
    geometry: Options = field(default_factory=Options)
    reconstruct: Options = field(default_factory=Options)
    gravity: Options = field(default_factory=Options)
    ground: Options = field(default_factory=Options)
    segment: Options = field(default_factory=Options)
    mesh: Options = field(default_factory=Options)
    place: Options = field(default_factory=Options)


@pytest.mark.parametrize(
    ("chosen", "stops"),
    [
        (Chosen(), ()),
        (Chosen(reconstruct=Options("doubler")), ()),
        (Chosen(reconstruct=Options("doubler"), segment=Options("tripler")), ("segment",)),
        (Chosen(reconstruct=Options("doubler"), segment=Options("doubler")), ()),
        (
            Chosen(
                reconstruct=Options("doubler"),
                gravity=Options(methods=("planes", "tripler")),
                place=Options("doubler"),
            ),
            ("align_gravity", "place_object"),
        ),
        (
            Chosen(reconstruct=Options("doubler"), ground=Options("tripler")),
            ("ground_targets",),
        ),
    ],
)
def test_a_scene_stops_where_its_model_changes(
    home: Path, chosen: Chosen, stops: tuple[str, ...]
) -> None:
    assert stops_of(chosen) == stops  # type: ignore[arg-type]


def test_every_option_of_a_preset_that_can_name_a_model_has_its_step() -> None:
    for option, step in passes.STEP_OF.items():
        assert hasattr(Preset(), option)
        assert isinstance(getattr(import_module(f"tasks.{step}"), step), Step)
    for option in fields(Preset):
        config = type(getattr(Preset(), option.name))
        named = {name for hint in get_type_hints(config).values() for name in texts(hint)}
        if named & foundation.ADAPTERS.keys():
            assert option.name in passes.STEP_OF, f"{option.name} can name a model"


def texts(hint: Any) -> Iterator[str]:
    """Give the texts that a hint such as ``tuple[Literal["a", "b"], ...]`` allows."""
    for argument in get_args(hint):
        if isinstance(argument, str):
            yield argument
        else:
            yield from texts(argument)


def test_passes_come_in_order_within_a_wave() -> None:
    assert postponed(STOPS, 0) == STOPS
    assert postponed(STOPS, 1) == ()
    assert priority(5, 0, ()) == (0, 0, 5)
    queue = [priority(position, passed, STOPS) for position in (0, 40) for passed in (1, 0)]
    assert sorted(queue) == [(0, 0, 0), (0, 1, 0), (1, 0, 40), (1, 1, 40)]


def test_jobs_without_models_take_one_pass_in_their_order(home: Path) -> None:
    job = JobOrder("a", "m:f")
    assert (job.models, job.stops, job.postponed) == ((), (), ())
    assert SceneRow("a").executed == 0
