"""Ask a model in a step, as the pipeline does: looked up, loaded, answered, published."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from garden_models.meshing.mesh_model import MeshAnswer, MeshRequest
from garden_models.placement.pose_model import PoseAnswer, PoseRequest
from garden_models.reconstruction.geometry_model import GeometryPrediction, GeometryRequest
from garden_models.segmentation.mask_model import MaskAnswer, MaskRequest
from tasks.model import backend_of, predictor, weights_of
from tasks.step import step


@dataclass(frozen=True)
class Questions:
    """What is asked, one after the other."""

    SCHEMA: ClassVar[str] = "benchmark.Questions/1"
    questions: tuple[GeometryRequest | MaskRequest | MeshRequest | PoseRequest, ...]


@dataclass(frozen=True)
class Answers:
    """What was answered."""

    SCHEMA: ClassVar[str] = "benchmark.Answers/1"
    answers: tuple[GeometryPrediction | MaskAnswer | MeshAnswer | PoseAnswer, ...]


def _backend(model: str, **_others: object) -> str:
    return backend_of(model)


def _weights(model: str, **_others: object) -> dict[str, str]:
    return weights_of(model)


@step(version=1, backend=_backend, weights=_weights, retries=0)
def ask_model(questions: Questions, model: str, repeat: int) -> Answers:
    """Return a model's answers; ``repeat`` tells one run from another."""
    with predictor(model) as predict:
        return Answers(tuple(predict(question) for question in questions.questions))
