"""Run a model in a process of its own, of any Python, and hold it to its limits.

The protocol is that of docs/model_workers.md. A worker that dies, takes too long or too much,
or does not keep to the protocol is ended with all that it started; the next question starts
another one.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelFailed, ModelOutOfMemory
from storage.redact import redact
from tasks.model.launch import Launch
from tasks.model.log import model_log
from tasks.model.worker_error import raised_in_worker
from tasks.model.worker_start import start_worker
from tasks.model_worker import protocol
from tasks.step.child_process import Garbled
from tasks.step.ref import Cancelled

Report = Callable[[float, str], None]

_POLL_S = 0.1
_MOST = 1e9  # seconds or gigabytes: more is no answer
_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|[^\x20-\x7e\xa0-\U0010ffff\t]")


def never() -> bool:
    """Tell that nobody stops."""
    return False


class ModelWorker:
    """One worker with one model; ``alive`` until it fails or is closed.

    ``gpu`` is the only one that it sees, if given. ``loaded`` is what it says of its loading.
    """

    def __init__(self, launch: Launch, gpu: str | None = None) -> None:
        self.launch = launch
        self.alive = True
        self.loaded: dict[str, float] = {}
        self._asked = 0
        self._gpu = gpu
        self._log = model_log(launch.name)
        self._told = 0
        self._child = start_worker(launch, gpu)

    def ask(
        self, folder: Path, digest: str, report: Report, stopped: Callable[[], bool] = never
    ) -> dict[str, Any]:
        """Have the question in an exchange folder answered; return what is said of the answer.

        Raises:
            ModelFailed: the worker is no more, or the model raised an error of a foreign kind.
            ModelOutOfMemory: it needs more memory than there is, or than it may hold.
            BadInput, BadGeometry: as raised by the adapter.
            Cancelled: ``stopped`` said so; the worker is no more.
        """
        deadline = time.monotonic() + self.launch.time_limit_s
        try:
            if not self.loaded:
                self._load(deadline, report, stopped)
            self._asked += 1
            question = {"id": self._asked, "folder": str(folder), "digest": digest}
            self._say({protocol.ASK: question})
            said = self._expect(protocol.ANSWER, deadline, report, stopped)
            if said.get("id") != self._asked or not isinstance(said.get("digest"), str):
                raise self._ended("answered another question than it was asked")
            return {"digest": said["digest"], **self._costs(said)}
        except _Told as told:
            if not self.loaded:
                self.close()
            raise told.error from None
        except BaseException:
            self.close()
            raise
        finally:
            self._pass_on_log()

    def close(self) -> None:
        """End the worker."""
        if self.alive:
            self.alive = False
            self._child.kill()
            self._pass_on_log()
            stdin = self._child.process.stdin
            with contextlib.suppress(OSError):
                if stdin is not None:
                    stdin.close()
            os.close(self._child.answers)
            self._child.output.unlink(missing_ok=True)

    def _load(self, deadline: float, report: Report, stopped: Callable[[], bool]) -> None:
        hello = self._expect(protocol.HELLO, deadline, report, stopped)
        if hello.get("protocol") != protocol.VERSION:
            raise self._ended(
                f"speaks {hello.get('protocol')}, and this GARDEN {protocol.VERSION}:"
                " use the same version of GARDEN there"
            )
        launch = self.launch
        self._say(
            {
                protocol.LOAD: {
                    "name": launch.name,
                    "module": launch.module,
                    "weights": str(launch.weights),
                    "device": launch.device if self._gpu is None else "cuda",
                    "dtype": launch.dtype,
                }
            }
        )
        self.loaded = self._costs(self._expect(protocol.LOADED, deadline, report, stopped))

    def _costs(self, said: dict[str, Any]) -> dict[str, float]:
        """Return the seconds and gigabytes that the worker tells."""
        costs = {name: said.get(name, 0.0) for name in protocol.COSTS}
        for name, cost in costs.items():
            if isinstance(cost, bool) or not isinstance(cost, int | float) or not 0 <= cost < _MOST:
                raise self._ended(f"tells {str(cost)[:40]!r} as {name}")
        return costs

    def _say(self, message: dict[str, Any]) -> None:
        stdin = self._child.process.stdin
        assert stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it died: its end of the other pipe says so
            stdin.write(json.dumps(message).encode() + b"\n")
            stdin.flush()

    def _expect(
        self, word: str, deadline: float, report: Report, stopped: Callable[[], bool]
    ) -> dict[str, Any]:
        """Wait for one message, and pass on progress and the log until it comes."""
        while True:
            try:
                found = self._heard(word, report)
            except (Garbled, TypeError, ValueError, KeyError) as error:
                raise self._ended(f"does not keep to the protocol: it wrote {error}") from None
            if found is not None:
                return found
            self._pass_on_log()
            if self._child.silent:
                raise self._ended(self._child.how_it_died(), subject="")
            self._check(deadline, stopped)

    def _heard(self, word: str, report: Report) -> dict[str, Any] | None:
        for message in self._child.messages(_POLL_S):
            if protocol.PROGRESS in message:
                share, doing = message[protocol.PROGRESS]
                report(float(share), redact(str(doing)))
            elif protocol.ERROR in message:
                raise _Told(raised_in_worker(self.launch.name, message[protocol.ERROR]))
            elif isinstance(message.get(word), dict):
                found: dict[str, Any] = message[word]
                return found
            else:
                raise Garbled(json.dumps(message)[:80])
        return None

    def _check(self, deadline: float, stopped: Callable[[], bool]) -> None:
        if stopped():
            self.close()
            raise Cancelled("the run was stopped")
        name, limit_gb = self.launch.name, self.launch.memory_limit_gb
        if time.monotonic() > deadline:
            raise self._ended(
                f"was stopped after {self.launch.time_limit_s:g} s, its time limit: give it less"
                f" at once, or raise {name}.time_limit_s in the model settings"
            )
        self._child.weigh()
        if limit_gb is not None and self._child.peak.mb > limit_gb * 1000:
            peak = self._child.peak.mb / 1000
            self.close()
            raise ModelOutOfMemory(
                f"{name} was stopped at {peak:.1f} GB, above its memory limit of {limit_gb:g} GB:"
                f" give it less at once, or raise {name}.memory_limit_gb in the model settings"
            )

    def _ended(self, how: str, subject: str = "its worker ") -> ModelFailed:
        tail = self._child.tail() if subject else ""
        self.close()
        printed = f"; it printed last: {tail}" if tail else ""
        return ModelFailed(redact(f"{self.launch.name}: {subject}{how}{printed}"))

    def _pass_on_log(self) -> None:
        """Write what the worker printed since the last time into our log, less the secrets."""
        with contextlib.suppress(OSError), self._child.output.open("rb") as printed:
            printed.seek(self._told)
            for line in printed:
                if not line.endswith(b"\n") and self.alive:
                    break  # it is still being written
                self._told += len(line)
                text = _CONTROL.sub("", line.decode(errors="replace").rstrip())
                self._log.info("%s", redact(text))


class _Told(Exception):
    """Carry an error that the worker told of, and survived."""

    def __init__(self, error: Exception) -> None:
        super().__init__(str(error))
        self.error = error
