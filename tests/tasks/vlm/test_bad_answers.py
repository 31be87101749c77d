"""Ways in which models answer badly, and what must come of each.

The answers come over HTTP as a server gives them. In every photo, 2000 x 1000 pixels, the
mug is at (200, 300) to (400, 700) and the chair at (1000, 100) to (1600, 900).
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import pytest

from garden_models.progress import silent
from garden_models.scene import BadInput, Capture, Target
from garden_models.targets.boxes import validate
from garden_models.targets.config import ProposeTargets
from garden_models.targets.propose import propose_targets
from tasks.vlm import asker
from tests.tasks.vlm.conftest import SIZE
from tests.vlm_server import LOCAL_MODEL, MODEL, Reply, VlmServer, targets_json

MUG_BOX, CHAIR_BOX = [300, 100, 700, 200], [100, 500, 900, 800]  # top, left, bottom, right
MUG = Target("mug", "IMG_1.jpg", (200.0, 300.0, 400.0, 700.0))
CHAIR = Target("chair", "IMG_2.jpg", (1000.0, 100.0, 1600.0, 900.0))
GOOD = targets_json(("mug", "P1", MUG_BOX), ("chair", "P2", CHAIR_BOX))


def entry(name: object = "mug", photo: object = "P1", box: object = MUG_BOX, **more: object) -> str:
    return json.dumps({"name": name, "photo": photo, "box_2d": box, **more})


@dataclass(frozen=True)
class Way:
    """An answer, the targets that come of it, the status, and words of the reasons."""

    name: str
    said: str | Reply
    targets: tuple[Target, ...] = (MUG, CHAIR)
    status: str = "ok"
    reasons: tuple[str, ...] = ()


CUT = GOOD[: GOOD.index('"chair"') + 20]
WAYS = [
    Way("as asked", GOOD),
    Way("in a fence", f"```json\n{GOOD}\n```"),
    Way("with prose around", f"Sure! I looked at [all] photos {{P1..P3}}.\n{GOOD}\nAnything else?"),
    Way("after thinking aloud", f'<think>maybe {{"targets": []}}?</think>\n{GOOD}'),
    Way("a fence that never ends", f"Here it is:\n```\n{GOOD}"),
    Way("a bare list", f"[{entry()}, {entry('chair', 'P2', CHAIR_BOX)}]"),
    Way("wrapped twice", json.dumps({"response": {"data": json.loads(GOOD)}})),
    Way("by name", json.dumps({
        "mug": {"photo": "P1", "box_2d": MUG_BOX}, "chair": {"photo": 2, "box_2d": CHAIR_BOX}})),
    Way("by photo", json.dumps({
        "P1": [{"label": "mug", "box_2d": MUG_BOX}],
        "P2": [{"label": "chair", "bbox_2d": CHAIR_BOX}]})),
    Way("as Python writes it", str(json.loads(GOOD))),
    Way("trailing commas", GOOD.replace("}]", "},]").replace("]}", "],}")),
    Way("broken off", Reply(CUT, finish="cut"), (MUG,), "degraded",
        ("the server cut the answer", "whole entries read from it: 1")),
    Way("numbers as texts", f'[{entry(box=["300", "100.0", "700", "200"])}]', (MUG,)),
    Way("a box as a text", f'[{entry(box="[300, 100, 700, 200]")}]', (MUG,)),
    Way("a box by its sides",
        f"[{entry(box={'xmin': 100, 'ymin': 300, 'xmax': 200, 'ymax': 700})}]", (MUG,)),
    Way("a corner and a size",
        f"[{entry(box={'x': 100, 'y': 300, 'width': 100, 'height': 400})}]", (MUG,)),
    Way("a box of two corners", f"[{entry(box=[[300, 100], [700, 200]])}]", (MUG,)),
    Way("corners swapped", f"[{entry(box=[700, 200, 300, 100])}]", (MUG,), "ok",
        ("mug: the corners of its box were swapped",)),
    Way("shares in place of thousandths", f"[{entry(box=[0.3, 0.1, 0.7, 0.2])}]", (MUG,), "ok",
        ("shares",)),
    Way("a little out of range", f"[{entry(box=[300, -10, 1020, 200])}]",
        (Target("mug", "IMG_1.jpg", (0.0, 300.0, 400.0, 1000.0)),), "ok", ("cut at the photo",)),
    Way("far out of range", f"[{entry()}, {entry('lamp', 'P1', [300, 1400, 700, 1900])}]", (MUG,),
        "degraded", ("left out lamp: its box lies outside of its photo", "propose.boxes")),
    Way("no area", f"[{entry()}, {entry('pin', 'P1', [300, 100, 300, 200])}]", (MUG,), "degraded",
        ("left out pin: its box has no area",)),
    Way("the whole photo", f"[{entry()}, {entry('room', 'P1', [0, 0, 1000, 1000])}]", (MUG,),
        "degraded", ("left out room: its box is the whole photo",)),
    Way("three numbers", f"[{entry()}, {entry('x', 'P1', [1, 2, 3])}]", (MUG,), "degraded",
        ("left out x: its box has 3 numbers in place of 4",)),
    Way("not a number", f"[{entry()}, {entry('x', 'P1', [1, None, 3, 4])}]", (MUG,), "degraded",
        ("left out x: its box is not of numbers",)),
    Way("infinite", f"[{entry()}, {entry('x', box=[1, 2, float('inf'), float('nan')])}]", (MUG,),
        "degraded", ("left out x: its box is not of finite numbers",)),
    Way("no box", f"[{entry()}, {entry('x', box=None)}]", (MUG,), "degraded",
        ("left out x: it has no box",)),
    Way("a photo that was not shown", f"[{entry()}, {entry('x', 'P9')}]", (MUG,), "degraded",
        ("left out x: it names the photo 'p9', which was not shown",)),
    Way("no photo", f"[{entry()}, {entry('x', '')}]", (MUG,), "degraded",
        ("left out x: it names no photo",)),
    Way("photos by number and by file",
        f"[{entry(photo=1)}, {entry('chair', 'img_2.JPG', CHAIR_BOX)}]"),
    Way("photos in words", f"[{entry(photo='Photo 1')}, {entry('chair', 'image_2', CHAIR_BOX)}]"),
    Way("one name for two things",
        targets_json(("mug", "P1", MUG_BOX), ("Mug", "P1", CHAIR_BOX)),
        (MUG, Target("Mug_2", "IMG_1.jpg", CHAIR.box))),
    Way("one thing in two photos", targets_json(("mug", "P2", [310, 110, 600, 190]),
        ("mug", "P1", MUG_BOX)), (MUG,), "ok", ("boxed in IMG_2.jpg too",)),
    Way("one thing under two names", targets_json(("mug", "P1", MUG_BOX),
        ("cup", "P1", [302, 100, 698, 201])), (MUG,), "ok", ("cup: the same box as mug",)),
    Way("a name that is a path", targets_json(("../../etc/mug", "P1", MUG_BOX)),
        (Target("etc_mug", "IMG_1.jpg", MUG.box),),
        "ok", ("its name was '../../etc/mug'",)),
    Way("no name", targets_json(("", "P1", MUG_BOX)),
        (Target("object", "IMG_1.jpg", MUG.box),), "ok", ("it had no name",)),
    Way("a name without end", targets_json(("mug " * 60, "P1", MUG_BOX)),
        (Target("mug_mug_mug_mug_mug_mug_mug_mug_mug_mug_mug_mug", "IMG_1.jpg", MUG.box),), "ok"),
]  # fmt: skip


@pytest.mark.parametrize("model", [MODEL, LOCAL_MODEL])
@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.name)
def test_what_can_be_used_is_used_and_the_rest_is_said(
    way: Way, model: str, vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    config = replace(config, model=model, boxes="yxyx_1000")
    vlm.say(way.said)
    found = propose_targets(capture, (), config, asker(config, silent))
    assert found.targets == way.targets
    validate(found.targets, {photo.name: SIZE for photo in capture.photos})
    assert found.verdict.status == way.status
    said = "; ".join(found.verdict.reasons)
    assert all(words in said for words in way.reasons), said
    if way.status == "ok" and not way.reasons and "name" not in way.name:
        assert found.verdict.reasons == ()
    text = way.said if isinstance(way.said, str) else way.said.text
    assert found.queries[0].answer == text


def test_pixels_in_the_other_order_are_told_by_what_does_not_fit(
    vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    config = replace(config, boxes="xyxy_px", photo_side=1000)
    turned = targets_json(("mug", "P1", [150, 100, 350, 200]), ("chair", "P2", [50, 500, 450, 800]))
    vlm.say(turned)
    found = propose_targets(capture, (), config, asker(config, silent))
    assert found.targets == (MUG, CHAIR)
    assert found.verdict.status == "degraded"
    assert "across and down in the place of each other" in found.verdict.reasons[0]


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        ('{"targets": []}', "proposed no target that can be used (for the goal: "),
        ("[]", "proposed no target that can be used"),
        ("I am sorry, I cannot help with that.", "holds no list of boxes: I am sorry"),
        ('{"error": "overloaded", "code": [1, 2, 3]}', "holds no list of boxes"),
        ("{" * 5000 + "[" * 5000, "holds no list of boxes"),
        (f"[{entry(photo='P9')}]", "proposed no target that can be used (mug: it names the photo"),
        ('{"targets": [{"name": "mug", "photo": "P1", "box_2d": [30', "holds no list of boxes"),
    ],
)  # fmt: skip
def test_an_answer_of_which_nothing_can_be_used_is_one_sentence(
    said: str, sentence: str, vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    vlm.say(said)
    with pytest.raises(BadInput) as caught:
        propose_targets(capture, (), config, asker(config, silent))
    assert sentence in str(caught.value)
    assert config.model in str(caught.value)
    assert "\n" not in str(caught.value)
