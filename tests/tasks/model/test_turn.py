"""Whose turn it is: few loads, and nobody waits for ever."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hypothesis import example, given
from hypothesis import strategies as st

from tasks.model.launch import Launch
from tasks.model.turn import MOST_OVERTAKEN, next_turn, overtake


def launch(name: str) -> Launch:
    return Launch(name, "m", Path("w"), "cpu", None, 60.0, None, "float32", "")


@dataclass
class Asked:
    launch: Launch
    overtaken: int = 0


A, B = launch("a"), launch("b")


def test_nobody_waits() -> None:
    assert next_turn([], None) is None
    assert next_turn([], A) is None


def test_the_oldest_goes_first_unless_a_younger_one_needs_no_load() -> None:
    queue = [Asked(A), Asked(B), Asked(A)]
    assert next_turn(queue, None) == 0
    assert next_turn(queue, A) == 0
    assert next_turn(queue, B) == 1


@example(["a"] * 200)
@given(st.lists(st.sampled_from("ab"), min_size=1, max_size=400))
def test_nobody_is_overtaken_more_often_than_the_bound(names: list[str]) -> None:
    """Questions arrive one a turn; each is answered after a bounded number of turns."""
    arriving, queue, loaded = list(names), [Asked(B)], A
    while arriving or queue:
        if arriving:
            queue.append(Asked(launch(arriving.pop())))
        turn = next_turn(queue, loaded)
        assert turn is not None
        overtake(queue, turn)
        loaded = queue.pop(turn).launch
        assert all(q.overtaken <= MOST_OVERTAKEN for q in queue)


@given(st.lists(st.sampled_from("ab"), min_size=1, max_size=MOST_OVERTAKEN))
def test_all_that_waits_is_answered_with_one_load_a_model(names: list[str]) -> None:
    queue, loaded, loads = [Asked(launch(name)) for name in names], None, 0
    while queue:
        turn = next_turn(queue, loaded)
        assert turn is not None
        overtake(queue, turn)
        chosen = queue.pop(turn).launch
        loads += chosen != loaded
        loaded = chosen
    assert loads == len(set(names))
