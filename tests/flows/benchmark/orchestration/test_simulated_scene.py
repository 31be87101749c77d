"""The simulated scene: the real flow's steps, as many and as dependent, and nothing twice."""

from __future__ import annotations

from pathlib import Path

from flows import factorize
from flows.benchmark.orchestration import simulated_scene as simulated
from flows.benchmark.orchestration.simulated_scene import STEPS_A_SCENE, steps_of
from storage import Store
from tasks.step import RunContext, Step, run_context


def run(store: Store, number: int, objects: int) -> RunContext:
    with run_context(RunContext(store, f"scene_{number}")) as context:
        simulated.simulated_scene(number, objects)
    return context


def test_it_has_the_real_flows_steps(tmp_path: Path) -> None:
    real = {value.name for value in vars(factorize).values() if isinstance(value, Step)}
    assert {value.name for value in vars(simulated).values() if isinstance(value, Step)} == real
    store = Store.open(tmp_path, durability="none")
    ran = run(store, 0, 2).outcomes
    assert {event.step for event in ran} == real
    assert len(ran) == steps_of(2)
    assert sum(event.label == "" for event in ran) == STEPS_A_SCENE


def test_a_second_run_executes_nothing_and_scenes_share_nothing(tmp_path: Path) -> None:
    store = Store.open(tmp_path, durability="none")
    first, other, again = (run(store, number, 2).outcomes for number in (0, 1, 0))
    assert {event.outcome for event in first + other} == {"executed"}
    assert {event.outcome for event in again} == {"cached"}
    objects = [event.ref.object for event in first + other if event.ref]
    assert len(set(objects)) == len(objects)
