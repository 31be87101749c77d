"""What is asked: the photos under their labels, the goal, the model's own box convention."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from garden_models.progress import silent
from garden_models.scene import BadInput, Capture, Target
from garden_models.targets.box_convention import CONVENTIONS, BoxConvention
from garden_models.targets.config import ProposeTargets
from garden_models.targets.propose import check_targets, propose_targets
from tasks.vlm import asker
from tests.vlm_server import LOCAL_MODEL, VlmServer, targets_json

MUG = (200.0, 300.0, 400.0, 700.0)
WRITTEN = {
    "yxyx_1000": [300, 100, 700, 200],
    "xyxy_1000": [100, 300, 200, 700],
    "xyxy_px": [50, 75, 100, 175],
    "xyxy_px_resized": [50.4, 75.6, 100.8, 176.4],
    "xyxy_unit": [0.1, 0.3, 0.2, 0.7],
}
"""The mug in a photo of 2000 x 1000 pixels that is sent at 500 x 250, or resized to 504 x 252."""


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_box_comes_back_in_the_photos_pixels_from_every_convention(
    convention: BoxConvention, vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    wanted = replace(config, boxes=convention, photo_side=500)
    said = targets_json(("mug", "P2", WRITTEN[convention]), key="bbox_2d")
    vlm.say(said, json.dumps({"targets": []}))
    found = propose_targets(capture, (), wanted, asker(wanted, silent))
    assert found.targets == (Target("mug", "IMG_2.jpg", pytest.approx(MUG, abs=1e-6)),)  # type: ignore[arg-type]
    check_targets(capture, (), found, wanted, asker(wanted, silent))
    listed = next(line for line in vlm.asked[1].prompt.splitlines() if '"P2"' in line)
    written = json.loads(listed)
    again = next(value for key, value in written.items() if key.endswith("box_2d"))
    assert np.allclose(again, WRITTEN[convention], atol=0.5)


def test_every_photo_comes_after_its_label_at_the_size_that_was_asked_for(
    vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    vlm.say(targets_json(("mug", "P1", [300, 100, 700, 200])))
    wanted = replace(config, goal="the mug is knocked over", photo_side=400)
    propose_targets(capture, ("IMG_2.jpg",), wanted, asker(wanted, silent))
    asked = vlm.asked[0]
    assert asked.texts[:2] == ["P1:", "P2:"]
    assert "the mug is knocked over" in asked.prompt
    assert "P2 (400 x 200 pixels)" in asked.prompt
    assert "IMG_" not in json.dumps(asked.document)
    shown = [cv2.imdecode(np.frombuffer(p, np.uint8), cv2.IMREAD_COLOR) for p in asked.pictures]
    assert [picture.shape for picture in shown] == [(200, 400, 3)] * 2
    sent = [photo.rgb for photo in capture.photos if photo.name != "IMG_2.jpg"]
    for picture, rgb in zip(shown, sent, strict=True):
        assert np.abs(picture[..., ::-1].mean((0, 1)) - rgb.mean((0, 1))).max() < 3


def test_photos_are_chosen_evenly(vlm: VlmServer, config: ProposeTargets, capture: Capture) -> None:
    vlm.say(targets_json(("mug", "P2", [300, 100, 700, 200])))
    wanted = replace(config, max_photos=2)
    found = propose_targets(capture, (), wanted, asker(wanted, silent))
    assert found.queries[0].photos == ("IMG_1.jpg", "IMG_3.jpg")
    assert found.targets[0].photo == "IMG_3.jpg"
    with pytest.raises(BadInput, match="no photo is left"):
        propose_targets(
            capture, [photo.name for photo in capture.photos], wanted, asker(wanted, silent)
        )


def test_both_apis_are_held_to_the_schema_unless_that_is_switched_off(
    vlm: VlmServer, config: ProposeTargets, capture: Capture
) -> None:
    local = replace(config, model=LOCAL_MODEL, temperature=0.0, thinking="low")
    for wanted in (config, local, replace(local, structured=False)):
        key = "box_2d" if wanted is config else "bbox_2d"
        vlm.say(targets_json(("mug", "P1", [100, 300, 200, 700]), key=key))
        propose_targets(capture, (), wanted, asker(wanted, silent))
    google, openai, plain = (asked.document for asked in vlm.asked)
    schema = google["generationConfig"]["responseSchema"]
    item = schema["properties"]["targets"]["items"]
    assert (schema["type"], item["properties"]["box_2d"]["items"]) == (
        "OBJECT",
        {"type": "INTEGER"},
    )
    assert "additionalProperties" not in json.dumps(google)
    assert not {"temperature", "thinkingConfig"} & google["generationConfig"].keys()
    strict = openai["response_format"]["json_schema"]
    assert strict["schema"]["properties"]["targets"]["items"]["required"] == [
        "name", "photo", "bbox_2d", "why",
    ]  # fmt: skip
    assert (openai["model"], openai["temperature"]) == (LOCAL_MODEL, 0.0)
    assert openai["reasoning_effort"] == "low"
    assert "response_format" not in plain
