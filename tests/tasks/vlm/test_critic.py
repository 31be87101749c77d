"""The critic's repair is applied, and never more than it says (over HTTP, as a server gives it)."""

from __future__ import annotations

import json
from typing import Any

import pytest

from garden_models.progress import silent
from garden_models.scene import BadInput, Capture, Target
from garden_models.targets.config import ProposeTargets
from garden_models.targets.proposal import TargetProposal
from garden_models.targets.propose import check_targets, propose_targets
from tasks.vlm import asker
from tests.vlm_server import Reply, VlmServer, targets_json

MUG_BOX, CHAIR_BOX, LAMP_BOX = [300, 100, 700, 200], [100, 500, 900, 800], [200, 20, 300, 80]
MUG = Target("mug", "IMG_1.jpg", (200.0, 300.0, 400.0, 700.0))
CHAIR = Target("chair", "IMG_2.jpg", (1000.0, 100.0, 1600.0, 900.0))
PROPOSED = targets_json(("mug", "P1", MUG_BOX), ("chair", "P2", CHAIR_BOX))


class Check:
    """Propose the mug and the chair, and give what the critic's answer makes of them."""

    def __init__(self, vlm: VlmServer, capture: Capture, config: ProposeTargets) -> None:
        self.vlm, self.capture, self.config = vlm, capture, config

    def __call__(self, said: str | Reply, proposed: str | Reply = PROPOSED) -> TargetProposal:
        self.vlm.say(proposed, said)
        ask = asker(self.config, silent)
        first = propose_targets(self.capture, (), self.config, ask)
        return check_targets(self.capture, (), first, self.config, ask)


@pytest.fixture
def check(vlm: VlmServer, capture: Capture, config: ProposeTargets) -> Check:
    return Check(vlm, capture, config)


def changes(found: TargetProposal) -> list[tuple[Any, ...]]:
    return [
        (c.kind, c.before and c.before.name, c.after and c.after.name, c.why) for c in found.changes
    ]


def test_boxes_are_moved_added_and_removed(check: Check) -> None:
    found = check(
        targets_json(
            ("mug", "P1", [310, 100, 900, 250]),
            ("lamp", "P3", LAMP_BOX),
            removed=[{"name": "chair", "why": "built in"}],
        )
    )
    mug = Target("mug", "IMG_1.jpg", (200.0, 310.0, 500.0, 900.0))
    lamp = Target("lamp", "IMG_3.jpg", (40.0, 200.0, 160.0, 300.0))
    assert found.targets == (mug, lamp)
    assert found.proposed == (MUG, CHAIR)
    assert changes(found) == [
        ("moved", "mug", "mug", "needed"),
        ("removed", "chair", None, "built in"),
        ("added", None, "lamp", "needed"),
    ]
    assert [q.purpose for q in found.queries] == ["propose", "critic"]
    assert found.verdict.status == "ok"


def test_what_it_agrees_with_is_no_change(check: Check) -> None:
    found = check(PROPOSED)
    assert (found.targets, found.changes, found.verdict.reasons) == ((MUG, CHAIR), (), ())


def test_it_may_name_the_better_photo(check: Check) -> None:
    found = check(targets_json(("mug", "P3", MUG_BOX), ("chair", "P2", CHAIR_BOX)))
    assert [t.photo for t in found.targets] == ["IMG_3.jpg", "IMG_2.jpg"]
    assert changes(found) == [("moved", "mug", "mug", "needed")]


def test_a_target_that_it_passes_over_stays(check: Check) -> None:
    found = check(targets_json(("lamp", "P3", LAMP_BOX)))
    assert [t.name for t in found.targets] == ["mug", "chair", "lamp"]
    assert "the critic passed over mug, chair, which stay as proposed" in found.verdict.reasons
    assert check(json.dumps({"targets": []})).targets == (MUG, CHAIR)


def test_another_name_on_the_same_box_is_the_same_target(check: Check) -> None:
    found = check(targets_json(("red_cup", "P1", [310, 100, 690, 200]), ("chair", "P2", CHAIR_BOX)))
    assert [t.name for t in found.targets] == ["red_cup", "chair"]
    assert changes(found)[0][:3] == ("renamed", "mug", "red_cup")


def test_removals_may_be_bare_names(check: Check) -> None:
    found = check(json.dumps({"targets": [], "removed": ["Chair"]}))
    assert found.targets == (MUG,)


def test_removals_count_in_an_answer_that_is_not_quite_json_too(check: Check) -> None:
    said = targets_json(("mug", "P1", MUG_BOX), removed=[{"name": "chair", "why": "fixed"}])
    assert check(said.replace("}]}", "},],}")).targets == (MUG,)


def test_a_repair_that_cannot_be_used_leaves_the_target_as_it_was(check: Check) -> None:
    found = check(targets_json(("mug", "P1", [500, 100, 500, 200]), ("chair", "P2", CHAIR_BOX)))
    assert found.targets == (MUG, CHAIR)
    assert found.verdict.status == "degraded"
    assert "left out mug: its box has no area" in found.verdict.reasons


def test_an_answer_that_cannot_be_read_degrades_what_was_proposed(check: Check) -> None:
    found = check("The boxes look great!")
    assert found.targets == (MUG, CHAIR)
    assert found.verdict.status == "degraded"
    assert "the boxes were not checked" in found.verdict.reasons[0]
    assert found.queries[1].answer == "The boxes look great!"


def test_what_the_first_answer_lacked_is_a_remark_once_it_was_checked(check: Check) -> None:
    whole = targets_json(("mug", "P1", MUG_BOX), ("x", "P9", MUG_BOX))
    found = check(targets_json(("mug", "P1", MUG_BOX)), whole)
    assert found.verdict.status == "ok"
    assert "left out x" in found.verdict.reasons[0]


def test_a_critic_that_removes_everything_is_one_sentence(check: Check) -> None:
    with pytest.raises(BadInput, match="the critic removed all targets"):
        check(json.dumps({"targets": [], "removed": [{"name": "mug"}, {"name": "chair"}]}))


def test_more_than_were_asked_for_are_left_out(
    vlm: VlmServer, capture: Capture, config: ProposeTargets
) -> None:
    config = ProposeTargets(**{**vars(config), "max_targets": 2})
    found = Check(vlm, capture, config)(targets_json(("lamp", "P3", LAMP_BOX)))
    assert [t.name for t in found.targets] == ["mug", "chair"]
    assert found.changes == ()
    assert "lamp: beyond propose.max_targets = 2, left out" in found.verdict.reasons


def test_it_is_shown_the_boxes_and_told_them(check: Check) -> None:
    check(PROPOSED)
    first, second = check.vlm.asked
    assert '{"name": "mug", "photo": "P1", "box_2d": [300, 100, 700, 200]}' in second.prompt
    assert second.pictures[0] != first.pictures[0]  # a box was drawn
    assert second.pictures[2] == first.pictures[2]  # none in this one
