"""Time a model in a plain loop, with nothing of a worker around it; for benchmarks.

The fourth word of the command is a JSON file: name, module, weights, device, dtype, ``folder``
and ``digests`` of the questions, repeats. One JSON object is printed: seconds and peak memory.
"""

from __future__ import annotations

import contextlib
import json
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

from tasks.model_worker.calling import torch_mode
from tasks.model_worker.nouns import nouns_of
from tasks.model_worker.payload import read_payload
from tasks.model_worker.serve import peaks


def main() -> None:
    """Load, ask all questions ``repeats`` times, and print what it took."""
    order = json.loads(Path(sys.argv[4]).read_text("utf-8"))
    with contextlib.redirect_stdout(sys.stderr):
        told = _timed(order)
    print(json.dumps(told))


def _timed(order: dict[str, Any]) -> dict[str, Any]:
    started = time.monotonic()
    expected, _answer = nouns_of(order["module"])  # imports the adapter, as loading it does
    imported = time.monotonic() - started
    folder = Path(order["folder"])
    requests = [
        read_payload(folder / str(number), digest, expected)
        for number, digest in enumerate(order["digests"])
    ]
    started = time.monotonic()
    predict = import_module(order["module"]).load(Path(order["weights"]), order["device"])
    loaded = imported + time.monotonic() - started
    seconds = []
    with torch_mode(order["device"], order["dtype"]):
        for _ in range(order["repeats"]):
            started = time.monotonic()
            for request in requests:
                predict(request)
            seconds.append(time.monotonic() - started)
    return {"load_s": loaded, "run_s": seconds, **peaks()}
