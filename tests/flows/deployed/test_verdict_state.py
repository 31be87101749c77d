"""The state of a flow run says the verdict and the reasons, and no secret."""

from __future__ import annotations

import pytest

from flows.collection.row import SceneRow
from flows.deployed.collection import NAMED, not_ok
from flows.deployed.verdict_state import verdict_state


@pytest.mark.parametrize(
    ("status", "kind", "name"),
    [
        ("ok", "COMPLETED", "Completed"),
        ("degraded", "COMPLETED", "Degraded"),
        ("failed", "FAILED", "Failed"),
        ("stopped", "FAILED", "Failed"),
    ],
)
def test_a_verdict_is_a_state_with_its_reasons(status: str, kind: str, name: str) -> None:
    state = verdict_state(status, ["few photos", "no scale"], {"package": "scenes/desk"})
    assert (state.type.value, state.name) == (kind, name)
    assert state.message == "few photos; no scale"


def test_a_reason_that_holds_a_secret_is_told_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "wJalrXUtnFEMI")
    state = verdict_state("failed", ["refused: wJalrXUtnFEMI"], {})
    assert state.message == "refused: ***"


def test_a_collection_names_what_failed_before_what_is_degraded() -> None:
    rows = [
        SceneRow("attic", "degraded", ["scale unknown"]),
        SceneRow("desk", "ok"),
        SceneRow("shelf", "failed", ["no photos"]),
    ]
    assert not_ok(rows) == [
        "1 of 3 scenes failed",
        "shelf: no photos",
        "1 of 3 scenes degraded",
        "attic: scale unknown",
    ]


def test_a_long_night_is_told_in_short() -> None:
    rows = [SceneRow(f"room {number}", "failed", ["dark"]) for number in range(1000)]
    said = not_ok(rows)
    assert said[0] == "1000 of 1000 scenes failed"
    assert len(said) <= NAMED + 1
