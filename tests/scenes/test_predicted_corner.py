"""The sample capture reconstructed by a model that knows it, through the model's real adapter."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from flows.benchmark.sample import measure_sample
from flows.capture import find_capture
from flows.preset import Preset, with_settings
from flows.report.document import scene_verdict
from flows.report.values import load_values
from flows.scene_run import SceneRequest, SceneResult, run_scene
from garden_models import foundation
from garden_models.scene import Target
from garden_models.targets.boxes import parse_targets
from storage import Store
from tasks.model.resident import residents
from tasks.step import Budget, RunContext, run_context
from tests.doubles.true_geometry import put_truth
from tests.doubles.true_views import TrueViews, views_of_scene
from tests.doubles.truth_scene import corner_scene
from tests.scenes.corner_truth import CORNER, load_corner

METHOD = "depth_anything_3"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def truth() -> TrueViews:
    pytest.importorskip("depth_anything_3")
    return views_of_scene(corner_scene())


@pytest.fixture
def weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setitem(foundation.ADAPTERS, METHOD, "tests.doubles.true_geometry")
    monkeypatch.setenv("GARDEN_KEEPER", "off")
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    for name in ("CONFIG", "CACHE"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(tmp_path / name.lower()))
    residents.free()
    yield tmp_path / "weights" / METHOD
    residents.free()


def factorize(folder: Path, targets: tuple[Target, ...]) -> tuple[SceneResult, Store]:
    preset = with_settings(Preset(), {"geometry": {"method": METHOD, "gaussians": True}})
    source = find_capture(CORNER, None).source
    store = Store.open(folder / "store", durability="none")
    request = SceneRequest("corner", source, targets, preset, folder / "scenes" / "corner")
    (folder / "slots").mkdir(exist_ok=True)
    budget = Budget.of_machine(folder=folder / "slots")
    return run_scene(request, store, lambda _event: None, engine="local", budget=budget), store


def test_the_scene_is_factored_to_its_truth(
    truth: TrueViews, weights: Path, tmp_path: Path
) -> None:
    put_truth(weights, truth)
    targets = parse_targets(json.loads((CORNER / "targets.json").read_text()))
    result, store = factorize(tmp_path, targets)
    assert result.refs.failure is None
    assert scene_verdict(result).status == "ok"
    with run_context(RunContext(store=store, scene="corner")):
        values = load_values(result)
    assert values.cameras is not None and values.cameras.scale.source == "metric_depth"
    measures = measure_sample(values, load_corner())
    assert all(m.holds for m in measures), "\n".join(m.line() for m in measures)
    limits = {"misplaced": 1.0, "yaw": 1.0, "gravity": 1.0, "camera rotation": 0.05}
    for measure in measures:
        for name, limit in limits.items():
            if name in measure.name:
                assert measure.value <= limit, measure.line()
    assert values.gaussians is not None and len(values.gaussians.mean) > 200_000


def test_transposed_cameras_are_seen(truth: TrueViews, weights: Path, tmp_path: Path) -> None:
    put_truth(weights, truth, transposed=True)
    result, _ = factorize(tmp_path, ())
    verdict = scene_verdict(result)
    assert verdict.status != "ok"
    assert any("cameras or depths are not to be relied on" in r for r in verdict.reasons)
