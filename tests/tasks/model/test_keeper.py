"""One keeper for many processes: models are loaded once for all of them."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from garden_models.foundation.failure import ModelFailed, ModelOutOfMemory
from garden_models.scene import BadInput
from storage import Store
from tasks.model import predictor
from tasks.model.keeper_client import KeeperClient, keeper_address
from tasks.model.keeper_process import Costs, model_keeper, sweep_sockets
from tasks.model.resident import residents
from tasks.step import RunContext, Step, StepFailed, run_context
from tests.tasks.model.doubler import loads
from tests.tasks.model.misbehave import SLOW_S
from tests.tasks.model.nouns import Question
from tests.tasks.model.steps import TARGETS, Asking, ask, ask_apart
from tests.tasks.model.test_worker import settings
from tests.tasks.step.test_isolate import alive, wait_for

QUESTION = Question(np.ones((3, 2)))


@pytest.fixture
def keeper(models: Path) -> Iterator[Costs]:
    with model_keeper() as costs:
        yield costs


def test_it_answers_as_in_this_process(models: Path) -> None:
    with predictor("doubler") as predict:
        here = predict(QUESTION)
    before = residents.loads
    with model_keeper():
        with predictor("doubler") as predict:
            there = predict(QUESTION)
        assert keeper_address() is not None
    assert keeper_address() is None
    assert residents.loads == before
    assert np.array_equal(here.values, there.values)
    assert here.noise == there.noise


CLIENT = """
import os
import sys
import numpy as np
from tasks.model import predictor
from tests.tasks.model.misbehave import SLOW_S
from tests.tasks.model.nouns import Question
from tests.tasks.model.registered import register_if_told
register_if_told()
for name in sys.argv[1:]:
    with predictor(name) as predict:
        question = Question(np.ones((1, 2)), os.environ.get("HOW", ""))
        print(predict(question).values[0, 0], flush=True)
"""


def client(*words: str, how: str = "") -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-c", CLIENT, *words],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "HOW": how},
        stdout=subprocess.PIPE,
    )


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def test_processes_share_what_is_loaded(models: Path, keeper: Costs) -> None:
    processes = [client("doubler", "doubler") for _ in range(3)]
    said = [process.communicate(timeout=120)[0].split() for process in processes]
    assert said == [[b"2.0", b"2.0"]] * 3
    assert loads(models / "doubler") == 1
    cost = keeper()["doubler"]
    assert (cost["loads"], cost["calls"], cost["failures"]) == (1, 6, 0)
    assert cost["run_s"] > 0
    assert cost["peak_gb"] > 0.01


@pytest.mark.slow
def test_who_asks_the_loaded_model_goes_first(models: Path, keeper: Costs) -> None:
    """Many at once ask two models in turn on one device; each is loaded a few times at most."""

    def ask_both(name: str) -> float:
        with predictor(name) as predict:
            return float(predict(QUESTION).values[0, 0])

    names = ["doubler", "tripler"] * 12
    with ThreadPoolExecutor(len(names)) as pool:
        said = list(pool.map(ask_both, names))
    assert said == [2.0, 3.0] * 12
    assert loads(models / "doubler") + loads(models / "tripler") <= 6


@pytest.mark.slow
def test_a_model_in_use_is_kept_between_two_questions(models: Path, keeper: Costs) -> None:
    """Another model's question waits while the first asker is only computing for a moment."""
    with predictor("doubler") as double:
        double(QUESTION)
        other = threading.Thread(target=lambda: client("tripler").communicate(timeout=120))
        other.start()
        for _ in range(4):
            time.sleep(0.3)
            double(QUESTION)
        assert loads(models / "doubler") == 1
    other.join(120)
    assert loads(models / "tripler") == 1


@pytest.mark.parametrize(
    ("how", "error"),
    [
        ("bad", BadInput),
        ("memory", ModelOutOfMemory),
        ("die", ModelFailed),
        ("bug", ModelFailed),
        ("nan", ModelFailed),
    ],
)
def test_errors_come_back_typed_and_cost_one_question(
    models: Path, keeper: Costs, how: str, error: type[Exception]
) -> None:
    with predictor("doubler") as predict:
        predict(QUESTION)
        with pytest.raises(error):
            predict(Question(QUESTION.values, how))
        assert predict(QUESTION).values[0, 0] == 2.0
    assert loads(models / "doubler") == (2 if how == "die" else 1)
    assert keeper()["doubler"]["calls"] + keeper()["doubler"]["failures"] == 3


@pytest.mark.slow
def test_a_client_that_is_killed_lets_the_others_go_on(models: Path, keeper: Costs) -> None:
    hanging = client("doubler", how="hang")
    wait_for(lambda: loads(models / "doubler") == 1)
    hanging.send_signal(signal.SIGKILL)
    hanging.wait()
    with predictor("tripler") as predict:
        assert predict(QUESTION).values[0, 0] == 3.0


def test_a_stopped_run_lets_go_of_its_question(models: Path, keeper: Costs, store: Store) -> None:
    context = RunContext(store, "room")

    def stop() -> None:
        wait_for(lambda: loads(models / "doubler") == 1)
        context.cancelled.set()

    threading.Thread(target=stop).start()
    with run_context(context), pytest.raises(StepFailed) as caught:
        ask(TARGETS[0], Asking(how=(("good", "hang"),)))
    assert caught.value.kind == "Cancelled"
    with predictor("doubler") as predict:
        assert predict(QUESTION).values[0, 0] == 2.0


def test_a_keeper_of_another_version_is_refused(
    models: Path, keeper: Costs, monkeypatch: pytest.MonkeyPatch
) -> None:
    from tasks.model_worker import protocol

    monkeypatch.setattr(protocol, "VERSION", "garden.worker/99")
    with (
        pytest.raises(ModelFailed, match=r"keeper speaks garden\.worker/1, and this GARDEN garden"),
        predictor("doubler"),
    ):
        raise AssertionError


def test_a_keeper_that_is_gone_is_told(models: Path, tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setenv("GARDEN_KEEPER", str(tmp_path / "no.sock"))
    with (
        pytest.raises(ModelFailed, match=r"the models' keeper is gone .*: start the run again"),
        predictor("doubler"),
    ):
        raise AssertionError


@pytest.mark.slow
@pytest.mark.parametrize("step", [ask, ask_apart])
def test_time_in_the_queue_is_waiting_and_does_not_count_towards_a_limit(
    models: Path, keeper: Costs, store: Store, step: Step
) -> None:
    """Somebody else's question is answered first, which takes longer than the step may."""
    first = client("doubler", how="slow")
    wait_for(lambda: loads(models / "doubler") == 1)
    with run_context(RunContext(store, "room")):
        ref = step(TARGETS[0], Asking(others="tripler"))
    assert ref.seconds.wait > 1.0
    assert store.action(ref.key).seconds["wait"] == ref.seconds.wait
    assert first.wait(60) == 0
    assert step is ask or step.spec.time_limit_s < SLOW_S


def test_a_keeper_that_dies_is_started_again_and_the_question_asked_again(
    models: Path, keeper: Costs
) -> None:
    with predictor("doubler") as predict:
        worker = int(predict(Question(QUESTION.values, "pid")).noise)
        assert keeper()["doubler"]["calls"] == 1
        os.kill(parent_of(worker), signal.SIGKILL)
        assert predict(QUESTION).values[0, 0] == 2.0
    wait_for(lambda: not alive(worker))
    cost = keeper()["doubler"]
    assert (cost["loads"], cost["calls"]) == (2, 2)
    assert cost["peak_gb"] < 1


def test_sockets_of_the_killed_are_swept_and_of_the_living_are_not(tmp_path: Path) -> None:
    dead, young = tmp_path / "keeper-1.sock", tmp_path / "keeper-2.sock"
    for path in (dead, young):
        with socket.socket(socket.AF_UNIX) as killed:
            killed.bind(str(path))
    with socket.socket(socket.AF_UNIX) as living:
        living.bind(str(tmp_path / "keeper-3.sock"))
        living.listen()
        for name in ("keeper-1.sock", "keeper-3.sock"):
            os.utime(tmp_path / name, (1e9, 1e9))
        sweep_sockets(tmp_path)
        assert sorted(p.name for p in tmp_path.iterdir()) == ["keeper-2.sock", "keeper-3.sock"]


PARENT = """
import sys
import numpy as np
from tasks.model import predictor
from tasks.model.keeper_process import model_keeper
from tests.tasks.model.misbehave import SLOW_S
from tests.tasks.model.nouns import Question
from tests.tasks.model.registered import register_if_told
register_if_told()
with model_keeper(), predictor("doubler") as predict:
    print(int(predict(Question(np.ones((1, 2)), "pid")).noise), flush=True)
    predict(Question(np.ones((1, 2)), "hang"))
"""


@pytest.mark.slow
def test_keeper_and_workers_die_with_the_process_that_started_them(models: Path) -> None:
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
    )
    try:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        keeper = parent_of(worker)
        assert keeper != parent.pid
        parent.kill()
        wait_for(lambda: not alive(worker) and not alive(keeper))
    finally:
        parent.kill()


def test_its_socket_is_the_users_own_and_no_port_is_opened(models: Path, keeper: Costs) -> None:
    address = keeper_address()
    assert address is not None
    assert address.is_socket()
    assert address.stat().st_mode & 0o077 == 0
    assert address.parent.stat().st_mode & 0o077 == 0
    settings()
    client_ = KeeperClient(address)
    assert client_.status() == {}
    client_.close()
