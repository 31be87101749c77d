"""A scene that stops before a step of some target does nothing after it with the others."""

from __future__ import annotations

from typing import Any

import pytest

from flows import factorize
from flows.factorize import SceneRefs, factorize_scene
from flows.preset import Preset
from garden_models.scene import Target
from storage import Store
from tasks.ingest import CaptureSource
from tasks.step import Postponed, Ref, RunContext, StepFailed, run_context

TARGETS = tuple(Target(name, "a.jpg", (0.0, 0.0, 1.0, 1.0)) for name in ("mug", "pan", "jar"))
REF = Ref("Thing", "", "", "", "a step")


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Replace all steps by ones that note their name; one target's mesh is postponed."""
    names: list[str] = []

    def replace(name: str) -> None:
        def fake(*_args: Any, **_kwargs: Any) -> Ref:
            names.append(name)
            return REF

        monkeypatch.setattr(factorize, name, fake)

    for name in ("ingest", "register", "reconstruct", "align_gravity", "clean_background",
                 "compose", "simulate", "render"):  # fmt: skip
        replace(name)
    return names


def outcome_of(target: Target, refs: SceneRefs, preset: Preset) -> Any:
    if target.name == "pan":
        raise Postponed("mesh_object", target.name)
    if target.name == "jar":
        raise StepFailed("segment", target.name, "nothing is in its box")
    return factorize.FactoredObject(target, REF, REF, REF, REF)


def test_a_scene_stops_with_the_first_step_that_is_left_to_later(
    called: list[str], monkeypatch: pytest.MonkeyPatch, store: Store
) -> None:
    monkeypatch.setattr(factorize, "factor_object", outcome_of)
    refs = SceneRefs(TARGETS)
    with run_context(RunContext(store, "room")), pytest.raises(Postponed) as caught:
        factorize_scene(CaptureSource("photos", ()), TARGETS, Preset(), refs)
    assert (caught.value.step, caught.value.kind) == ("mesh_object", "Postponed")
    assert called == ["ingest", "register", "reconstruct", "align_gravity"]


@pytest.fixture
def store(tmp_path: Any) -> Store:
    return Store.open(tmp_path / "store", durability="none")
