"""The page opens alone, says the worst first, and can be read without seeing its pictures."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flows.factorize import SceneRefs
from flows.preset import read_preset
from flows.report.document import report_document
from flows.report.page import report_page, with_steps_of
from flows.report.values import SceneValues
from flows.scene_run import SceneRequest, SceneResult
from garden_models.scene import (
    Background,
    BodyMotion,
    GravityEvidence,
    GravityView,
    Reconstruction,
    Scale,
    SimScene,
    Target,
    Trajectory,
)
from tasks.ingest import CaptureSource
from tasks.step import Seconds, StepEvent, StepFailed, Why
from tests.garden_models.rendering.test_hybrid import BACK, at, ball, view


@pytest.fixture
def values(tmp_path: Path) -> SceneValues:
    """A ball that fell, before a wall; a second target failed; one step ran."""
    vase = Target("vase <2>", "a.jpg", (1, 1, 5, 5))
    source = CaptureSource("photos", ())
    request = SceneRequest("desk", source, (vase,), read_preset("embedded", []), tmp_path)
    failed = ((vase, StepFailed("segment", vase.name, "its box holds no points")),)
    refs = SceneRefs((vase,), failed_targets=failed)
    ran = StepEvent(
        "finished", "ingest", "", "desk", 0.0, outcome="executed", backend="embedded",
        seconds=Seconds(compute=1.5), why=Why("input", "photo a.jpg changed"),
    )  # fmt: skip
    scale = Scale("unknown", 0.5, "assumed")
    body = replace(ball("mug"), gv_from_body=at(0, 0, 1.5))
    cue = GravityEvidence("camera_x_axes", np.array([0, 1.0, 0]), 0.5, True)
    trajectory = Trajectory(
        np.array([0.0, 10.0]),
        np.array([[[0, 0, 1.5]], [[0, 0.2, 1.5]]]),
        np.tile([1.0, 0, 0, 0], (2, 1, 1)),
        (BodyMotion("mug", 0, 0.2, 0, True),),
    )
    return SceneValues(
        result=SceneResult(request, refs, [ran], 12.3),
        capture=None,
        cameras=None,
        reconstruction=Reconstruction((view("a.jpg"),), BACK, np.zeros((0, 3)), (), scale),
        gravity_view=GravityView(np.eye(4), "a.jpg", np.array([0, 1.0, 0]), 0.5, (cue,)),
        objects=(),
        background=Background(BACK, np.zeros(len(BACK), bool), {}),
        scene=SimScene((body,), (), scale),
        trajectory=trajectory,
        renders=None,
    )


@pytest.fixture
def page(values: SceneValues) -> str:
    return report_page(values, report_document(values))


def test_it_opens_without_a_network(page: str) -> None:
    assert "http" not in page
    sources = re.findall(r'\b(?:src|href)="([^"]*)"', page)
    assert sources
    assert all(source.startswith(("data:", "#")) for source in sources)


def test_the_verdict_and_its_reasons_come_first(page: str) -> None:
    body = page[page.index("<body>") :]
    top = body[: body.index("<nav>")]
    assert 'class="verdict degraded"' in top
    assert "vase &lt;2&gt;: its box holds no points" in top
    assert "Steps: 1 executed, in 12.3 s" in top


def test_a_failed_object_tells_what_its_earlier_steps_doubted(values: SceneValues) -> None:
    name = values.result.refs.targets[0].name
    values.result.outcomes += [
        StepEvent(
            "finished", "find_rivals", label, "desk", 0.0, outcome=outcome,
            status=status, reasons=(reason,),
        )
        for label, outcome, status, reason in (
            (name, "executed", "degraded", "its box lies on another one"),
            (name, "cached", "ok", "one remark"),
            ("cup", "executed", "degraded", "another one's doubt"),
        )
    ]  # fmt: skip
    document = report_document(values)
    (entry,) = document["objects"]
    assert entry["reasons"] == [
        "its box holds no points",
        "find_rivals: its box lies on another one",
    ]
    assert "find_rivals: its box lies on another one" in report_page(values, document)


def test_pictures_have_words_and_links_have_ends(page: str) -> None:
    pictures = re.findall(r"<img [^>]*>", page)
    assert len(pictures) >= 3
    assert all(re.search(r'alt="[^"]{5,}"', picture) for picture in pictures)
    assert page.count("<figure>") == page.count("<figcaption>")
    for target in re.findall(r'href="#([^"]*)"', page):
        assert f'id="{target}"' in page
    assert re.findall(r"<h(\d)", page)[0] == "1"


def test_the_viewer_has_objects_and_background(page: str) -> None:
    groups = json.loads(re.search(r"data-groups='([^']*)'", page)[1])  # type: ignore[index]
    assert {g["name"] for g in groups} == {"background", "objects"}
    data = re.search(r'id="points-data">([^<]*)<', page)
    assert data
    assert len(data[1]) == 4 * 3 * sum(g["count"] for g in groups)
    assert 'data-group="objects"' in page
    first = json.loads(re.search(r"data-view='([^']*)'", page)[1])  # type: ignore[index]
    assert first["elevation"] > 0
    assert "no WebGL" in page


def test_points_are_shown_before_there_are_objects(values: SceneValues) -> None:
    bare = replace(values, background=None, scene=None, trajectory=None)
    page = report_page(bare, report_document(bare))
    assert "data-groups" in page
    assert 'data-group="objects"' not in page
    nothing = replace(bare, reconstruction=None, gravity_view=None)
    assert "data-groups" not in report_page(nothing, report_document(nothing))


def test_a_rerun_replaces_what_is_told_of_the_run(values: SceneValues, page: str) -> None:
    again = replace(values.result.outcomes[0], outcome="cached", why=Why("hit", "found"))
    values.result.outcomes[:] = [again]
    values.result.seconds = 0.4
    told = with_steps_of(page, report_document(values))
    assert "Steps: 1 found in the store, in 0.4 s" in told
    assert "12.3 s" not in told
    assert "photo a.jpg changed" not in told
    assert len(told) == pytest.approx(len(page), abs=200)


def test_names_from_outside_bring_no_markup(values: SceneValues) -> None:
    """Photos are called what their sender called them; a report is passed on and opened."""
    hostile = "\"><img src=x onerror='alert(1)'>.jpg"
    assert values.reconstruction and values.gravity_view
    renamed = replace(
        values,
        reconstruction=replace(
            values.reconstruction,
            views=tuple(replace(v, photo=hostile) for v in values.reconstruction.views),
            unregistered=(hostile,),
        ),
        gravity_view=replace(values.gravity_view, reference_photo=hostile),
    )
    page = report_page(renamed, report_document(renamed))
    assert "onerror=&#x27;alert" in page
    assert "<img src=x" not in page
    assert "onerror='" not in page
