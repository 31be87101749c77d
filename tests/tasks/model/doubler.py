"""A model of a few lines: it doubles; its factor is its weight file."""

from __future__ import annotations

import os
import random
from pathlib import Path

import numpy as np

from garden_models.foundation.model_card import ModelCard, Terms, WeightFile
from tests.tasks.model.misbehave import HOW
from tests.tasks.model.nouns import Answer, Ask, Part, Question

CARD = ModelCard(
    name="doubler",
    title="Doubler",
    source="here",
    stage="segment",
    terms=Terms("Apache-2.0", "Apache-2.0", commercial=True),
    weights=(WeightFile("factor.txt", "a number"), WeightFile("more/")),
    imports=("numpy",),
)


def load(weights: Path, device: str) -> Ask:
    with (weights / "loads.txt").open("a") as loads:
        loads.write(f"{device} {os.environ.get('CUDA_VISIBLE_DEVICES')}\n")
    factor = float((weights / "factor.txt").read_text())

    def ask(question: Question) -> Answer:
        if question.how in HOW:
            wrong: Answer = HOW[question.how](question)
            return wrong
        noise = random.random() + float(np.random.uniform())
        parts = (Part(np.eye(4), "upright"),) if len(question.values) else ()
        return Answer(question.values * factor, noise, parts)

    return ask


def put_weights(folder: Path, factor: float = 2.0) -> None:
    (folder / "more").mkdir(parents=True, exist_ok=True)
    (folder / "factor.txt").write_text(str(factor))
    (folder / "more" / "a.bin").write_bytes(b"a")


def loads(folder: Path) -> int:
    file = folder / "loads.txt"
    return len(file.read_text().splitlines()) if file.exists() else 0
