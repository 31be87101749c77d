"""Run a thousand simulated scenes through the collection runner, and again over the result."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from flows.benchmark.orchestration.growth import Growth, growth_by_part
from flows.benchmark.orchestration.sampling import Sample, sampled
from flows.benchmark.orchestration.server import Server, prefect_server
from flows.benchmark.orchestration.simulated_job import simulated_orders
from flows.benchmark.orchestration.simulated_scene import steps_of
from flows.collection.definition import Collection
from flows.collection.run import CollectionResult, Options, RowEvent, run_jobs
from flows.collection.state import STATE
from flows.server_profile import SERVER_PROFILES
from storage import Store
from tasks.step import Budget

Engine = Literal["local", "prefect"]
_SAY_EVERY = 50


@dataclass(frozen=True)
class ScaleOptions:
    """How many scenes of how many objects, and what runs them."""

    scenes: int = 1000
    objects: int = 5
    engine: Engine = "prefect"
    processes: int = 2
    profile: str = "lean"

    @property
    def steps(self) -> int:
        """All steps of all scenes."""
        return self.scenes * steps_of(self.objects)


@dataclass(frozen=True)
class FinishedScene:
    """When a scene was finished (``time.time``), and its seconds in its worker."""

    at: float
    seconds: float


@dataclass(frozen=True)
class ServerGrowth:
    """What the Prefect server cost in all; its database's size and rows before and after."""

    cpu_s: float
    drain_s: float
    bytes_before: int
    bytes_after: int
    rows: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Restart:
    """A second run over finished scenes, in a new process, from its start to its end."""

    seconds: float
    executed: int
    cached: int


@dataclass(frozen=True)
class ScaleResult:
    """All that was measured. ``state_bytes`` is the size of the collection's state file;
    ``wrong`` names scenes that failed, or ran other steps than they should.
    """

    options: ScaleOptions
    started: float
    wall_s: float
    finished: list[FinishedScene]
    samples: list[Sample]
    store: dict[str, Growth]
    restart: Restart
    state_bytes: int
    server: ServerGrowth | None = None
    wrong: tuple[str, ...] = ()


def measure_scale(
    options: ScaleOptions, folder: Path, say: Callable[[str], None] = lambda _: None
) -> ScaleResult:
    """Run all scenes from an empty store below ``folder``, then run them all again."""
    finished: list[FinishedScene] = []

    def note(event: RowEvent) -> None:
        if event.kind == "finished":
            finished.append(FinishedScene(time.time(), event.row.seconds or 0.0))
            if len(finished) % _SAY_EVERY == 0:
                say(f"{len(finished)} of {options.scenes} scenes")

    with ExitStack() as stack:
        server = None
        if options.engine == "prefect":
            profile = SERVER_PROFILES[options.profile]
            server = stack.enter_context(prefect_server(folder / "prefect", profile))
        before = _server_state(server)
        started = time.time()
        with sampled(server) as samples:
            result = run_scenes(options, folder, note)
        wall = time.time() - started
        grown = None if server is None else _server_growth(server, before)
    say("again, over finished scenes")
    restart = _restart(options, folder)
    store = growth_by_part(folder / "store")
    state = (folder / "out" / STATE).stat().st_size
    wrong = tuple(_wrong(result, options))
    return ScaleResult(
        options, started, wall, finished, samples, store, restart, state, grown, wrong
    )


def run_scenes(
    options: ScaleOptions, folder: Path, on_event: Callable[[RowEvent], None] = lambda _: None
) -> CollectionResult:
    """Run the scenes as a collection into ``folder`` (``store/``, ``out/``, ``slots/``)."""
    collection = Collection("simulated", (), folder / "out", "simulated scenes")
    slots = folder / "slots"
    slots.mkdir(exist_ok=True)
    run = Options(options.engine, options.processes, budget=Budget.of_machine(folder=slots))
    Store.open(folder / "store")
    orders = simulated_orders(options.scenes, options.objects)
    return run_jobs(collection, orders, str(folder / "store"), run, on_event)


def _wrong(result: CollectionResult, options: ScaleOptions) -> Iterator[str]:
    for row in result.rows:
        if row.status != "ok":
            yield f"{row.name} is {row.status}: {'; '.join(row.reasons)}"
        elif row.executed + row.cached != steps_of(options.objects):
            yield f"{row.name} ran {row.executed} and found {row.cached} steps"
    if missing := options.scenes - len(result.rows):
        yield f"{missing} of {options.scenes} scenes did not come out"


def _restart(options: ScaleOptions, folder: Path) -> Restart:
    fresh = multiprocessing.get_context("spawn")
    started = time.monotonic()
    with ProcessPoolExecutor(1, mp_context=fresh) as pool:
        executed, cached = pool.submit(run_again, options, folder).result()
    return Restart(time.monotonic() - started, executed, cached)


def run_again(options: ScaleOptions, folder: Path) -> tuple[int, int]:
    """Run the scenes once more in this process; return the steps executed and found."""
    rows = run_scenes(options, folder).rows
    return sum(row.executed for row in rows), sum(row.cached for row in rows)


def _server_state(server: Server | None) -> tuple[float, int]:
    return (0.0, 0) if server is None else (server.usage().cpu_s, server.database_bytes())


def _server_growth(server: Server, before: tuple[float, int]) -> ServerGrowth:
    drained = server.drain()
    cpu, size = _server_state(server)
    return ServerGrowth(cpu - before[0], drained, before[1], size, server.rows())
