"""The words that GARDEN and a model's worker exchange (docs/model_workers.md)."""

from __future__ import annotations

VERSION = "garden.worker/1"
"""Changes whenever a worker of before would misunderstand; both sides must have the same."""

HELLO, LOAD, ASK = "hello", "load", "ask"
LOADED, PROGRESS, ANSWER, ERROR = "loaded", "progress", "answer", "error"
STATUS = "status"
"""What only the keeper is asked: what each model cost so far."""

COSTS = ("seconds", "peak_gb", "peak_gpu_gb")
"""What ``loaded`` and ``answer`` tell: wall-clock time, resident memory, memory of a GPU."""

REQUEST_FOLDER, ANSWER_FOLDER = "request", "answer"
"""Of an exchange folder: what is asked, and where the answer is written."""
