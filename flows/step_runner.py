"""Choose who computes the steps of a run: this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from flows.wrong_use import WrongUse
from storage import Store
from tasks.step import Ref

DASK = "dask:"
AT_ONCE_ELSEWHERE = 64
"""Steps of one scene that may wait for workers at once; each is a sleeping thread here."""

Elsewhere = Callable[[Any], Ref] | None


@dataclass(frozen=True)
class Runner:
    """What the options say: ``name`` is that of ``step_runner``, None for this machine."""

    name: str | None = None
    shared_store: bool = False


HERE = Runner()


def add_runner_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say who computes."""
    parser.add_argument(
        "--runner",
        metavar="dask:tcp://HOST:PORT",
        help="compute the steps on the workers of this Dask scheduler (default: here)",
    )
    parser.add_argument(
        "--shared-store",
        action="store_true",
        help="the store's folder is the same folder on the machines of all workers",
    )


@contextmanager
def step_runner(runner: str | None, store: Store, *, shared: bool = False) -> Iterator[Elsewhere]:
    """Give what computes calls elsewhere (``RunContext.elsewhere``); None for this machine.

    Raises:
        WrongUse: there is no such runner, or it cannot be used with this store.
    """
    if runner is None:
        yield None
        return
    scheme, _, address = runner.partition(":")
    if scheme != "dask" or not address.startswith(("tcp://", "tls://")):
        raise WrongUse(f"{runner} is no runner: give {DASK}tcp://HOST:PORT, a Dask scheduler's")
    try:
        from tasks.step.dask_runner import DaskRunner, RunnerError

        with DaskRunner(address, store.address, shared) as elsewhere:
            yield elsewhere
    except ModuleNotFoundError as error:
        if error.name != "distributed":
            raise
        raise WrongUse(
            "the runner needs the package distributed: pip install 'garden-scenes[dask]'"
        ) from error
    except RunnerError as error:
        raise WrongUse(str(error)) from error
