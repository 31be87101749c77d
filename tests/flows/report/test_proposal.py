"""The report shows who proposed what, what the check changed, and the answers themselves."""

from __future__ import annotations

from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from flows.factorize import SceneRefs
from flows.preset import Preset
from flows.report.document import report_document
from flows.report.page import report_page
from flows.report.proposal_document import ANSWER_SHOWN
from flows.report.values import SceneValues
from flows.scene_run import SceneRequest, SceneResult
from garden_models.scene import Capture, Photo, Target, Verdict
from garden_models.targets.proposal import Query, TargetChange, TargetProposal
from tasks.ingest import CaptureSource

MUG, MOVED = Target("mug", "a.jpg", (10, 10, 60, 60)), Target("mug", "a.jpg", (10, 10, 90, 90))
LAMP = Target("lamp <1>", "a.jpg", (120, 10, 160, 90))
SECRET = "s3cret-of-the-server"
PROPOSAL = TargetProposal(
    model="gemini-3-flash",
    goal="clear the <table>",
    targets=(MOVED, LAMP),
    proposed=(MUG,),
    changes=(
        TargetChange("moved", MUG, MOVED, "the handle was cut"),
        TargetChange("added", None, LAMP, "stands in the way"),
    ),
    queries=(
        Query("propose", "What?", f"<b>{SECRET}</b>" + "x" * 9000, "gemini", ("a.jpg",), 1200, 80),
        Query("critic", "Right?", "{}", "gemini", ("a.jpg",), 1300, None),
    ),
    verdict=Verdict("degraded", ("left out pin: its box has no area",)),
)


@pytest.fixture
def values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SceneValues:
    monkeypatch.setenv("THAT_API_KEY", SECRET)
    request = SceneRequest("desk", CaptureSource("photos", ()), (), Preset(), tmp_path)
    result = SceneResult(request, SceneRefs((MOVED, LAMP)))
    photo = Photo("a.jpg", np.zeros((50, 100, 3), np.uint8), (200, 100))
    nothing = (None,) * 3
    return SceneValues(
        result, Capture((photo,)), *nothing, (), *nothing, renders=None, proposal=PROPOSAL
    )


def test_the_document_holds_boxes_changes_answers_and_cost(values: SceneValues) -> None:
    told = report_document(values)["proposal"]
    assert (told["model"], told["goal"]) == ("gemini-3-flash", "clear the <table>")
    assert [(t["name"], t["box"], t["score"]) for t in told["targets"]] == [
        ("mug", [10, 10, 90, 90], None),
        ("lamp <1>", [120, 10, 160, 90], None),
    ]
    assert [(c["kind"], c["why"]) for c in told["changes"]] == [
        ("moved", "the handle was cut"),
        ("added", "stands in the way"),
    ]
    assert told["tokens"] == {"input": 2500, "output": 80}
    assert len(told["queries"][0]["answer"]) < ANSWER_SHOWN + 10
    assert SECRET not in str(told)


def test_scores_of_a_detector_are_told(values: SceneValues) -> None:
    found = TargetProposal("grounding_dino", "", (MUG,), (MUG,), scores=(0.75,))
    told = report_document(replace(values, proposal=found))["proposal"]
    assert told["targets"][0]["score"] == 0.75
    assert told["tokens"] == {"input": None, "output": None}


def test_the_page_shows_them(values: SceneValues) -> None:
    document = report_document(values)
    page = report_page(values, document)
    start = page.index("Proposed targets <span")
    section = page[start : page.index("</section>", start)]
    words = unescape(section)
    assert 'class="verdict degraded"' in section
    assert "clear the &lt;table&gt;" in section
    assert "the handle was cut" in words
    assert "mug in a.jpg: 10, 10, 60, 60" in words
    assert "1,200 tokens asked and 80 tokens answered" in words
    assert "<b>" not in section
    assert section.count("<figure>") == 1


def test_without_a_proposal_there_is_no_section(values: SceneValues) -> None:
    given = replace(values, proposal=None)
    document = report_document(given)
    assert document["proposal"] is None
    assert "Proposed targets" not in report_page(given, document)
