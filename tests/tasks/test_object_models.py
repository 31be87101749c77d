"""Segmenting, meshing and placing ask the model that their options name, and key by it."""

from __future__ import annotations

from pathlib import Path

import pytest

from garden_models.meshing.config import MeshObject
from garden_models.placement.config import PlaceObject
from garden_models.scene import BadInput, Rivals
from garden_models.segmentation.config import Segment
from tasks.mesh_object import mesh_object
from tasks.model.resident import residents
from tasks.place_object import place_object
from tasks.segment import segment
from tasks.step.decorator import Step
from tests.doubles.corner import install, put_fault
from tests.doubles.corner_reconstruction import corner_reconstruction, corner_target

STEPS = [
    (segment, Segment(), Segment(method="sam3")),
    (segment, Segment(), Segment(method="sam2")),
    (mesh_object, MeshObject(), MeshObject(method="sam3d_objects")),
    (place_object, PlaceObject(), PlaceObject(method="foundation_pose")),
]
each_step = pytest.mark.parametrize(
    ("step", "embedded", "asking"), STEPS, ids=[config.method for _, _, config in STEPS]
)


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("GARDEN_MODELS", raising=False)
    install(monkeypatch, tmp_path / "weights")
    residents.free()
    return tmp_path / "weights"


def backend(step: Step, config: object) -> str:
    assert callable(step.spec.backend)
    return step.spec.backend(config=config)


def digests(step: Step, config: object) -> dict[str, object]:
    assert step.spec.weights is not None
    return dict(step.spec.weights(config=config))


@each_step
def test_the_embedded_method_needs_no_model(step, embedded, asking, monkeypatch) -> None:
    monkeypatch.setenv("GARDEN_WEIGHTS", "/nowhere")
    assert backend(step, embedded) == "embedded" and digests(step, embedded) == {}


@each_step
def test_the_model_and_its_weights_are_part_of_the_key(step, embedded, asking, weights) -> None:
    assert backend(step, asking).startswith(asking.method)
    before = digests(step, asking)
    assert before
    put_fault(weights, asking.method, "another file")
    assert digests(step, asking) != before


@each_step
def test_weights_that_are_not_there_are_asked_for(step, embedded, asking, weights) -> None:
    (weights / asking.method / "fault.txt").unlink()
    with pytest.raises(BadInput, match="put them at"):
        digests(step, asking)


@pytest.mark.parametrize("config", [Segment, MeshObject, PlaceObject])
def test_the_embedded_methods_are_the_defaults(config) -> None:
    assert config().method in {"geometric", "fusion", "render_and_compare"}


@pytest.mark.slow
def test_the_three_steps_ask_their_models_one_after_the_other(weights) -> None:
    scene = corner_reconstruction()
    masks = segment.fn(*scene, corner_target("duck"), Rivals(), Segment(method="sam3"))
    mesh = mesh_object.fn(*scene, masks, MeshObject(method="sam3d_objects"))
    config = PlaceObject(
        method="foundation_pose", max_views=3, pixels_per_view=1200, yaw_starts=8, refined_starts=1
    )
    placement = place_object.fn(*scene, masks, mesh, config)
    assert any(one.name.startswith("FoundationPose") for one in placement.hypotheses)
    assert "sam3d_objects" in mesh.completion[0]
    for verdict in (masks.verdict, mesh.verdict, placement.verdict):
        assert verdict.status == "ok", verdict
