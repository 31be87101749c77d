"""A model's own environment needs numpy, jaxtyping and what the model needs; nothing of ours."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

from tasks.model import predictor
from tests.tasks.model.bare_environment import bare_environment
from tests.tasks.model.nouns import Question
from tests.tasks.model.test_worker import settings

WHERE = "import sys, importlib.util as u; print([n for n in sys.argv[1:] if u.find_spec(n)])"
OURS = ("zarr", "pyarrow", "prefect", "blake3", "torch", "cv2", "garden_models", "tasks", "storage")


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bare_environment(tmp_path_factory.mktemp("bare") / "env")


def test_a_worker_runs_there(models: Path, bare: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = subprocess.run(
        [str(bare), "-c", WHERE, *OURS], capture_output=True, text=True, check=True, cwd="/",
        env={},
    )  # fmt: skip
    assert found.stdout.strip() == "[]"
    monkeypatch.setenv("PYTHONPATH", "/somewhere/else")
    settings(python=str(bare), time_limit_s=60)
    with predictor("doubler") as predict:
        answer = predict(Question(np.ones((3, 2))))
    assert answer.values.tolist() == [[2.0, 2.0]] * 3
    assert answer.noise > 0


def test_words_that_start_a_python_see_the_folders_that_they_need(
    models: Path, bare: Path, tmp_path: Path
) -> None:
    """As a container's command would: here a script notes its words and starts the Python."""
    script = tmp_path / "container"
    script.write_text(f'#!/bin/sh\necho "$1 $2 $3" > {tmp_path}/words\nshift 3\nexec {bare} "$@"\n')
    script.chmod(0o755)
    settings(
        python=[str(script), "-v={exchange}", "-v={weights}:ro", "-v={code}:ro"], time_limit_s=60
    )
    with predictor("doubler") as predict:
        assert predict(Question(np.ones((1, 2)))).values.tolist() == [[2.0, 2.0]]
    exchange, weights, code = (tmp_path / "words").read_text().split()
    assert "exchange" in exchange
    assert weights == f"-v={models / 'doubler'}:ro"
    assert (Path(code.removeprefix("-v=").removesuffix(":ro")) / "tasks").is_dir()
