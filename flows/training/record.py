"""Write the record of a training: what went in, how it went, what came out."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np

from flows.training.hardware import hardware, hours
from flows.training.pages import facts, loss_chart, page, pictures, section, table
from flows.training.point_classifier import EvaluationPairs, TrainedClassifier
from flows.training.run import write_whole
from garden_models.disentanglement.evaluation.method_scores import MethodScores
from garden_models.disentanglement.training.pair import PairShard
from garden_models.training.state import TrainingState
from tasks.step import load

CHECKPOINT, RECORD, PAGE = "point_classifier.safetensors", "record.json", "record.html"
SHOWN = 6
"""Pairs in the confusion gallery of each setting: the worst, and evenly those above."""


def write_record(
    folder: Path,
    trained: TrainedClassifier,
    checkpoint: bytes,
    pairs: dict[str, EvaluationPairs],
    scores: dict[str, MethodScores],
) -> dict[str, Any]:
    """Write checkpoint, ``record.json`` and ``record.html``; return the record."""
    from garden_models.training.weights_file import weights_digest

    state: TrainingState = load(trained.state, TrainingState)
    record = {
        "schema": "garden.training-record/1",
        "checkpoint": {
            "file": CHECKPOINT,
            "digest": weights_digest(checkpoint),
            "bytes": len(checkpoint),
        },
        "preset": dataclasses.asdict(trained.preset),
        "seed": trained.preset.optimisation.seed,
        "data": {
            "train": [ref.content for ref in trained.pairs],
            **{
                f"{split} {setting}": [ref.content for ref in getattr(asked, split)]
                for setting, asked in pairs.items()
                for split in ("validation", "test")
            },
        },
        "hardware": hardware(),
        "hours": hours((*trained.pairs, *trained.described), trained.states),
        "steps": state.step,
        "last_loss": round(float(np.mean(state.losses[-50:])), 6) if state.step else None,
        "scores": {setting: dataclasses.asdict(rows) for setting, rows in scores.items()},
    }
    write_whole(folder / CHECKPOINT, checkpoint)
    write_whole(folder / RECORD, json.dumps(record, indent=1).encode())
    html = _page(record, state, checkpoint, pairs, scores)
    write_whole(folder / PAGE, html.encode())
    return record


def score_rows(scores: dict[str, MethodScores]) -> list[dict[str, Any]]:
    """Return the supplement's table: one row a setting and method."""
    return [
        {"setting": setting, "method": score.method, **score.row, "settings": score.note}
        for setting, rows in scores.items()
        for score in rows.scores
    ]


def range_rows(scores: dict[str, MethodScores], name: str) -> list[dict[str, Any]]:
    """Return F1 by ``by_height``, ``by_size`` or ``by_family``."""
    return [
        {"setting": setting, "method": score.method, **getattr(score, name)}
        for setting, rows in scores.items()
        for score in rows.scores
    ]


def _page(
    record: dict[str, Any],
    state: TrainingState,
    checkpoint: bytes,
    pairs: dict[str, EvaluationPairs],
    scores: dict[str, MethodScores],
) -> str:
    preset = record["preset"]
    return page(
        f"Point classifier, preset {preset['name']}",
        [
            facts(
                {
                    "steps": record["steps"],
                    "batch": preset["optimisation"]["batch"],
                    "hours": record["hours"]["total"],
                    "threads": preset["optimisation"]["threads"],
                    "machine": record["hardware"]["processor"],
                    "checkpoint": f"{record['checkpoint']['bytes'] / 1e6:.2f} MB",
                }
            ),
            section("Loss", loss_chart(state.losses)),
            section("Held-out shapes and scenes", table(score_rows(scores))),
            section("F1 by height above the support", table(range_rows(scores, "by_height"))),
            section("F1 by size of the object", table(range_rows(scores, "by_size"))),
            section(
                "Right and wrong",
                '<p class="dim">orange: rightly taken, purple: wrongly taken, blue: wrongly '
                "kept, grey: rightly kept; the worst pair first</p>",
                *(_confusions(setting, asked, checkpoint) for setting, asked in pairs.items()),
            ),
            section("Record", f"<pre>{json.dumps(record, indent=1)}</pre>"),
        ],
    )


def _confusions(setting: str, asked: EvaluationPairs, checkpoint: bytes) -> str:
    """Return pictures of the first test shard's pairs, from the worst to the best."""
    from garden_models.disentanglement.evaluation.network_labels import probabilities
    from garden_models.disentanglement.network.checkpoint import from_bytes
    from garden_models.disentanglement.training.picture import by_outcome, cloud_picture
    from garden_models.metrics.classification import confusion

    shard: PairShard = load(asked.test[0], PairShard)
    model = from_bytes(checkpoint).model
    labels = probabilities(model, shard) >= 0.5
    f1 = np.array([confusion(a, b).f1 for a, b in zip(labels, shard.label, strict=True)])
    order = np.argsort(f1)
    shown = order[np.linspace(0, len(order) - 1, min(SHOWN, len(order))).astype(int)]
    named = {}
    for k in shown:
        points = shard.points[k].astype(float)
        box = np.stack([points.min(axis=0), points.max(axis=0)])
        colours = by_outcome(labels[k], shard.label[k])
        named[f"{shard.shapes[k]}, F1 {f1[k]:.3f}"] = cloud_picture(points, colours, box)
    return pictures(named, setting)
