"""The gravity table: every method on the same scenes, errors and curves as a document."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from flows.benchmark.gravity import GravityBenchmark, compare_gravity, truth_folder
from flows.command import main
from flows.command.benchmark.gravity import _document
from flows.training.gravity_record import score_rows
from flows.wrong_use import WrongUse
from garden_models.gravity.evaluation.conditions import CURVES, GIVEN
from garden_models.gravity.evaluation.methods import GravityErrors
from garden_models.gravity.evaluation.procedural import procedural_truth
from garden_models.gravity.evaluation.score import joined
from storage import Store

CORNER = Path(__file__).resolve().parents[2] / "scenes" / "corner"


def errors(scene: str, values: list[float]) -> GravityErrors:
    column = np.array(values)[:, None]
    return GravityErrors(("a", "b"), (scene,), column, np.ones_like(column))


def test_groups_of_scenes_become_one_row_a_method():
    rows = score_rows(joined((errors("one", [1.0, 20.0]), errors("two", [3.0, 4.0]))))
    assert [row["mean deg"] for row in rows] == [2.0, 12.0]
    assert [row["fail@10 %"] for row in rows] == [0.0, 50.0]
    assert rows[0]["scenes"] == 2


def test_a_model_that_is_not_here_is_told_before_any_work(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
    store = tmp_path / "store"
    assert main(["benchmark", "gravity", "--geocalib", "--store", str(store)]) == 2
    assert "geocalib" in capsys.readouterr().err
    assert not store.exists()


def test_the_truth_of_the_sample_is_found_in_its_folder(tmp_path):
    assert truth_folder(CORNER) == CORNER / "truth"
    assert truth_folder(tmp_path) == tmp_path


def test_a_capture_without_truth_is_refused(tmp_path):
    with pytest.raises(WrongUse, match=r"no cameras\.json"):
        compare_gravity(
            GravityBenchmark((tmp_path,), 0), None, Store.open(tmp_path / "s"), lambda event: None
        )


@pytest.mark.slow
def test_every_baseline_is_scored_on_test_scenes(tmp_path):
    config = GravityBenchmark(scenes=2, scenes_a_step=1)
    store = Store.open(tmp_path / "store")
    scores, curves = compare_gravity(config, None, store, lambda event: None)
    assert list(scores) == ["cameras given", "cameras estimated"]
    for rows in scores.values():
        assert [row.scenes for row in rows] == [("test 0", "test 1")] * len(rows)
        assert {"Plane-RANSAC", "COLMAP's Manhattan", "mean camera up"} <= {r.method for r in rows}
    document = json.loads(json.dumps(_document(scores, curves)))
    assert document["rows"][0]["setting"] == "cameras given"
    outcomes: list[str | None] = []
    again, _ = compare_gravity(config, None, store, lambda event: outcomes.append(event.outcome))
    assert set(filter(None, outcomes)) == {"cached"}
    np.testing.assert_array_equal(
        again["cameras given"][0].errors_deg, scores["cameras given"][0].errors_deg
    )


def test_conditions_are_what_they_say():
    roll = next(c for c in CURVES["camera roll"] if c.name == "90 degrees")
    truth = procedural_truth("test", 5, roll)
    x = np.array([view.camera_from_world[0, :3] for view in truth.reconstruction.views])
    assert np.abs(np.median(x @ truth.down_world)) > 0.6  # the camera's x axis is upright
    few = procedural_truth("test", 5, CURVES["number of views"][0])
    assert len(few.reconstruction.views) == 2
    level = procedural_truth("test", 5, GIVEN)
    assert level.reconstruction.cameras_source == "known"
