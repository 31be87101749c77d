"""Measure what a step costs when it misses and when it hits, each peer in its turn."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median

from flows.benchmark.orchestration.peers.all_peers import PEERS, check_installed
from flows.benchmark.orchestration.peers.peer import Pass, Peer, Run
from flows.benchmark.orchestration.pipeline import Chain, executed
from flows.benchmark.orchestration.server import Server, prefect_server
from storage.codec.content import content_digest

WARM_UP_STEPS = 3
HITS_A_REPEAT = 3


@dataclass(frozen=True)
class StepCost:
    """Milliseconds a step of one peer: medians, and all that was measured.

    ``server_ms`` is the CPU time of the Prefect server a step, which is spent beside.
    """

    peer: str
    chain: str
    note: str
    misses_ms: tuple[float, ...]
    hits_ms: tuple[float, ...]
    server_ms: tuple[float, ...] = ()

    @property
    def miss_ms(self) -> float:
        """The median of the first passes."""
        return median(self.misses_ms)

    @property
    def hit_ms(self) -> float:
        """The median of the passes after the first."""
        return median(self.hits_ms)


@dataclass
class _Samples:
    misses: list[float] = field(default_factory=list)
    hits: list[float] = field(default_factory=list)
    server: list[float] = field(default_factory=list)


class WrongResult(RuntimeError):
    """A peer gave another value, or ran other steps, than it should: no timing counts."""


def measure_steps(
    chains: tuple[Chain, ...],
    folder: Path,
    *,
    repeats: int,
    peers: tuple[Peer, ...] = PEERS,
    say: Callable[[str], None] = lambda _: None,
) -> list[StepCost]:
    """Run each chain with every peer, ``repeats`` times from an empty cache, in turns.

    The order is reversed at every other repeat. What a Prefect server still has to do is
    waited for, so that no peer pays for another. Raises PeerMissing and WrongResult.
    """
    check_installed(peers)
    with ExitStack() as stack:
        server = None
        if any(peer.on_server for peer in peers):
            server = stack.enter_context(prefect_server(folder / "prefect"))
        return [
            cost
            for chain in chains
            for cost in _measure_chain(chain, folder, repeats, peers, server, say)
        ]


def _measure_chain(
    chain: Chain,
    folder: Path,
    repeats: int,
    peers: tuple[Peer, ...],
    server: Server | None,
    say: Callable[[str], None],
) -> list[StepCost]:
    samples = {peer.name: _Samples() for peer in peers}
    for peer in peers:
        with _opened(peer, replace(chain, length=WARM_UP_STEPS), folder) as run:
            run()
            run()
    expected = content_digest(_plain(chain))
    for repeat in range(repeats):
        for peer in peers if repeat % 2 == 0 else peers[::-1]:
            say(f"{chain.name}, repeat {repeat + 1} of {repeats}: {peer.name}")
            with _opened(peer, chain, folder) as run:
                _measure(peer, chain, run, samples[peer.name], expected, server)
    return [
        StepCost(peer.name, chain.name, peer.note, tuple(s.misses), tuple(s.hits), tuple(s.server))
        for peer in peers
        for s in (samples[peer.name],)
    ]


def _measure(
    peer: Peer, chain: Chain, run: Run, samples: _Samples, expected: str, server: Server | None
) -> None:
    steps = chain.length + 1
    for number in range(1 + (1 if peer.on_server else HITS_A_REPEAT)):
        hits = number > 0
        executed.clear()
        before = server.usage().cpu_s if server and peer.on_server else 0.0
        outcome = run()
        if server and peer.on_server:
            server.drain()
            samples.server.append(1000 * (server.usage().cpu_s - before) / steps)
        _check(peer, outcome, expected, 0 if hits and peer.caches else steps)
        (samples.hits if hits else samples.misses).append(1000 * outcome.seconds / steps)


def _check(peer: Peer, outcome: Pass, expected: str, steps: int) -> None:
    if content_digest(outcome.value) != expected:
        raise WrongResult(f"{peer.name} gave another result than plain Python")
    if len(executed) != steps:
        raise WrongResult(f"{peer.name} executed {len(executed)} steps instead of {steps}")


def _plain(chain: Chain) -> object:
    value = chain.first(chain.seed)
    for change in chain.changes():
        value = chain.advance(value, change)
    return value


@contextmanager
def _opened(peer: Peer, chain: Chain, folder: Path) -> Iterator[Run]:
    with (
        tempfile.TemporaryDirectory(dir=folder) as place,
        peer.open(chain, Path(place)) as run,
    ):
        yield run
