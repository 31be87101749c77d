"""GroundingDINO through its real loading path: a tiny random checkpoint, saved and read again."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from garden_models.foundation import ADAPTERS, card
from garden_models.scene import BadInput
from garden_models.targets.grounding_dino import (
    CARD,
    answer_of,
    load,
    prepared,
    resized,
    text_of,
    tokens_of_labels,
)
from garden_models.targets.grounding_model import GroundingRequest
from tests.garden_models.targets.tiny_grounding_dino import save_tiny

LABELS = ("Red  mug", "chair")


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save_tiny(tmp_path_factory.mktemp("grounding_dino"))


def photo(width: int, height: int) -> np.ndarray:
    rng = np.random.default_rng(width)
    return rng.integers(0, 256, (height, width, 3)).astype(np.uint8)


@pytest.mark.slow
def test_it_is_registered_and_has_all_that_its_card_asks_for(weights: Path) -> None:
    assert ADAPTERS[CARD.name] == load.__module__
    assert card("grounding_dino").terms.commercial
    assert all((weights / file.path).is_file() for file in CARD.weights)


@pytest.mark.slow
def test_boxes_of_a_saved_network_are_those_of_its_own_processor(weights: Path) -> None:
    from transformers import (
        AutoTokenizer,
        GroundingDinoForObjectDetection,
        GroundingDinoImageProcessorPil,
        GroundingDinoProcessor,
    )

    rgb = photo(90, 60)
    with torch.inference_mode():
        answer = load(weights, "cpu")(GroundingRequest(rgb, LABELS, 0.0))
        network = GroundingDinoForObjectDetection.from_pretrained(weights).eval()
        processor = GroundingDinoProcessor(
            GroundingDinoImageProcessorPil(), AutoTokenizer.from_pretrained(weights)
        )
        inputs = processor(images=rgb, text=[["red mug", "chair"]], return_tensors="pt")
        found = network(**inputs)
    theirs: Any = processor.post_process_grounded_object_detection(
        found, inputs.input_ids, threshold=0.0, text_threshold=0.0, target_sizes=[(60, 90)]
    )[0]
    assert len(answer.boxes) == len(theirs["boxes"])
    assert (answer.scores[:-1] >= answer.scores[1:]).all()
    assert set(answer.label.tolist()) <= {0, 1}
    order = np.lexsort(answer.boxes.T)
    expected = np.clip(theirs["boxes"].numpy(), 0, [90, 60, 90, 60])
    np.testing.assert_allclose(answer.boxes[order], expected[np.lexsort(expected.T)], atol=1e-2)
    # The tokens of the labels are two of the words; theirs also takes full stops and [CLS].
    assert (answer.scores <= float(theirs["scores"].max()) + 1e-5).all()


@pytest.mark.slow
def test_a_photo_is_prepared_as_its_own_processor_does() -> None:
    from transformers import GroundingDinoImageProcessorPil

    processor = GroundingDinoImageProcessorPil()
    for size in ((90, 60), (60, 90), (300, 60), (64, 64)):
        theirs = processor(images=photo(*size), return_tensors="np")["pixel_values"][0]
        np.testing.assert_allclose(prepared(photo(*size)), theirs, atol=1e-5)


@pytest.mark.parametrize(
    ("size", "seen"),
    [((1600, 1200), (1066, 800)), ((1200, 1600), (800, 1066)), ((4000, 1000), (1333, 333))],
)
def test_the_short_side_becomes_800_unless_the_long_one_would_pass_1333(
    size: tuple[int, int], seen: tuple[int, int]
) -> None:
    assert resized(*size) == seen


def test_each_label_owns_the_tokens_of_its_words() -> None:
    text, spans = text_of(LABELS)
    assert text == "red mug. chair."
    assert [text[a:b] for a, b in spans] == ["red mug", "chair"]
    offsets = np.array([[0, 0], [0, 3], [4, 7], [7, 8], [9, 12], [12, 14], [14, 15], [0, 0]])
    assert tokens_of_labels(offsets, spans) == [[1, 2], [4, 5]]


def test_centres_and_shares_become_corners_in_pixels() -> None:
    request = GroundingRequest(photo(200, 100), LABELS, 0.5)
    probability = np.array([[0.9, 0.1, 0.2], [0.1, 0.2, 0.8], [0.1, 0.4, 0.3]])
    centred = np.array([[0.5, 0.5, 0.2, 0.4], [0.9, 0.1, 0.4, 0.4], [0.5, 0.5, 0.1, 0.1]])
    answer = answer_of(probability, centred, [[1], [2]], request)
    assert answer.label.tolist() == [1]
    np.testing.assert_allclose(answer.boxes, [[140, 0, 200, 30]])
    low = GroundingRequest(request.rgb, LABELS, 0.15)
    answer = answer_of(probability, centred, [[1], [2]], low)
    assert answer.label.tolist() == [1, 0, 1]
    np.testing.assert_allclose(answer.scores, [0.8, 0.4, 0.2])
    np.testing.assert_allclose(answer.boxes[2], [80, 30, 120, 70])


def _without_a_tensor(folder: Path) -> None:
    from safetensors.torch import load_file, save_file

    tensors = load_file(folder / "model.safetensors")
    name = next(name for name in tensors if "encoder" in name)
    del tensors[name]
    save_file(tensors, folder / "model.safetensors", metadata={"format": "pt"})


def _without_a_tokenizer(folder: Path) -> None:
    (folder / "tokenizer.json").unlink()


def _with_an_empty_config(folder: Path) -> None:
    (folder / "config.json").write_text("{}")


def _with_cut_weights(folder: Path) -> None:
    (folder / "model.safetensors").write_bytes(b"x" * 64)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (_without_a_tokenizer, "tokenizer.json is missing"),
        (_with_an_empty_config, "are not GroundingDINO's|do not fit"),
        (_with_cut_weights, "not GroundingDINO's"),
        (_without_a_tensor, "do not fit their config.json"),
    ],
)
def test_a_damaged_folder_says_what_to_do(
    harm: Callable[[Path], None], words: str, weights: Path, tmp_path: Path
) -> None:
    folder = shutil.copytree(weights, tmp_path / "weights")
    harm(folder)
    with pytest.raises(BadInput, match=words):
        load(folder, "cpu")


@pytest.mark.slow
def test_more_words_than_it_reads_are_refused(weights: Path) -> None:
    labels = ("mug",) * 200
    with torch.inference_mode(), pytest.raises(BadInput, match="look for fewer at once"):
        load(weights, "cpu")(GroundingRequest(photo(90, 60), labels, 0.3))
