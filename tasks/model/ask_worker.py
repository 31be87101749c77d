"""Take a question to a worker, and its answer back, as folders of plain files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from garden_models.foundation.failure import ModelFailed
from tasks.model.exchange import exchange
from tasks.model.launch import Launch
from tasks.model_worker.nouns import nouns_of
from tasks.model_worker.payload import BadPayload, read_payload, write_payload
from tasks.model_worker.protocol import ANSWER_FOLDER, REQUEST_FOLDER
from tasks.step.memory import see_elsewhere

AskFolder = Callable[[Path, str], dict[str, Any]]
"""Given an exchange folder and the question's digest, returns what is said of the answer."""


def ask_worker(ask: AskFolder, launch: Launch, request: Any) -> Any:
    """Return a worker's answer.

    Raises ModelFailed for an answer that is not whole or of another kind; and as ``ask`` does.
    """
    _request, expected = nouns_of(launch.module)
    with exchange() as folder:
        said = ask(folder, write_payload(request, folder / REQUEST_FOLDER))
        see_elsewhere(int(said["peak_gb"] * 1e9))
        try:
            return read_payload(folder / ANSWER_FOLDER, said["digest"], expected)
        except BadPayload as error:
            raise ModelFailed(f"{launch.name} answered nothing usable: {error}") from None
