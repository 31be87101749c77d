"""The peers of a step: the same values from all, nothing executed on a hit, no timing else."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.benchmark.orchestration import step_cost
from flows.benchmark.orchestration.cost import step_section
from flows.benchmark.orchestration.peers import all_peers
from flows.benchmark.orchestration.peers.all_peers import (
    JOBLIB,
    PEERS,
    STEPS,
    PeerMissing,
    check_installed,
)
from flows.benchmark.orchestration.peers.peer import Pass, Peer, Run
from flows.benchmark.orchestration.pipeline import CHAINS, Chain, Signal, first_signal
from flows.benchmark.orchestration.step_cost import HITS_A_REPEAT, WrongResult, measure_steps

HERE = tuple(peer for peer in PEERS if not peer.on_server)
QUICK = tuple(peer for peer in HERE if peer.package != "redun")  # which migrates a database
SHORT = tuple(replace(chain, length=5) for chain in CHAINS.values())


@pytest.mark.parametrize("peers", [QUICK, pytest.param(HERE, marks=pytest.mark.slow)])
def test_every_peer_misses_once_and_then_hits(tmp_path: Path, peers: tuple[Peer, ...]) -> None:
    costs = measure_steps(SHORT, tmp_path, repeats=1, peers=peers)
    assert [(c.chain, c.peer) for c in costs] == [(c.name, p.name) for c in SHORT for p in peers]
    for cost in costs:
        assert len(cost.misses_ms) == 1
        assert len(cost.hits_ms) == HITS_A_REPEAT
        assert min(cost.misses_ms + cost.hits_ms) > 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_peers_in_prefect_miss_once_and_then_hit(tmp_path: Path) -> None:
    peers = tuple(peer for peer in PEERS if peer.on_server)
    costs = measure_steps(SHORT[1:], tmp_path, repeats=1, peers=peers)
    assert [c.peer for c in costs] == [p.name for p in peers]
    for cost in costs:
        assert (len(cost.misses_ms), len(cost.hits_ms), len(cost.server_ms)) == (1, 1, 2)
        assert max(cost.server_ms) > 0


@contextmanager
def forgetful(chain: Chain, folder: Path) -> Iterator[Run]:
    yield lambda: Pass(1.0, step_cost._plain(chain))


@contextmanager
def mistaken(chain: Chain, folder: Path) -> Iterator[Run]:
    yield lambda: Pass(1.0, Signal(np.zeros(3)))


def test_a_hit_that_ran_something_is_no_hit(tmp_path: Path) -> None:
    with pytest.raises(WrongResult, match="executed 6 steps instead of 0"):
        measure_steps(SHORT, tmp_path, repeats=1, peers=(Peer("forgetful", forgetful),))


def test_a_wrong_value_is_not_timed(tmp_path: Path) -> None:
    with pytest.raises(WrongResult, match="another result"):
        measure_steps(SHORT, tmp_path, repeats=1, peers=(Peer("mistaken", mistaken),))


def test_a_missing_package_is_named_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(all_peers.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(PeerMissing, match=r"joblib and redun.*pip install.*benchmark"):
        check_installed(PEERS)


def test_the_chains_depend_on_every_step() -> None:
    for chain in SHORT:
        values = [step_cost._plain(replace(chain, length=length)) for length in (4, 5)]
        digests = {step_cost.content_digest(value) for value in values}
        assert len(digests) == 2
    assert first_signal(0).samples.nbytes == 4096


def test_the_claim_compares_our_hit_with_joblibs() -> None:
    def cost(peer: str, hit: float) -> step_cost.StepCost:
        return step_cost.StepCost(peer, "placement", "", (1.0,), (hit, 9.0, hit))

    section = step_section("placement", 10, [cost(STEPS, 0.3), cost(JOBLIB, 2.0)])
    (claim,) = section.claims
    assert claim.value == pytest.approx(0.15)
    assert claim.holds
    worse = step_section("placement", 10, [cost(STEPS, 0.5), cost(JOBLIB, 2.0)])
    assert not worse.claims[0].holds
    assert [row["hit / joblib's"] for row in worse.rows] == [0.25, 1.0]
