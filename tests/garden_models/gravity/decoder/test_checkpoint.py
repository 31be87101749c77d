"""A decoder that saw other data is refused: other tokens, version, unit, content, NaN."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import torch

from garden_models.gravity.decoder.checkpoint import (
    check_tokens,
    from_bytes,
    load_checkpoint,
    to_bytes,
)
from garden_models.gravity.decoder.config import DecoderConfig
from garden_models.gravity.decoder.familiarity import Familiarity
from garden_models.gravity.decoder.network import GravityViewDecoder
from garden_models.gravity.decoder.uncertainty import Calibration
from garden_models.scene import BadInput
from garden_models.training.weights_file import weights_digest

CONFIG = DecoderConfig(
    token_width=6, tokens="test/1", width=8, blocks=1, heads=2, feature=8, head=8, uncertain=True
)
CALIBRATION = Calibration((-3.0, -1.0), (-2.5, -0.5), 0.02)
FAMILIAR = Familiarity((0.0,) * 6, (1.0,) * 6, 2.0)


@pytest.fixture
def data() -> bytes:
    torch.manual_seed(0)
    return to_bytes(GravityViewDecoder(CONFIG), CALIBRATION, FAMILIAR, {"preset": "test"})


def rewritten(data: bytes, **changes: object) -> bytes:
    """Return the file with other entries in its description."""
    length = int.from_bytes(data[:8], "little")
    header = json.loads(data[8 : 8 + length])
    description = json.loads(header["__metadata__"]["garden"]) | changes
    header["__metadata__"]["garden"] = json.dumps(description)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data[8 + length :]


def test_what_is_written_is_read(data):
    known = from_bytes(data, "test/1", 6)
    assert known.calibration == CALIBRATION
    assert known.familiarity == FAMILIAR
    assert known.record == {"preset": "test"}
    assert known.digest == weights_digest(data)
    assert to_bytes(known.model, known.calibration, known.familiarity, known.record) == data


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "version is 2, this program needs 1"),
        ({"unit": "degree"}, "unit is 'degree'"),
        ({"kind": "point-classifier"}, "kind is 'point-classifier'"),
        ({"tokens": {"kind": "test/1", "width": 7}}, "tokens is"),
        ({"network": dataclasses.asdict(CONFIG) | {"width": 16}}, "do not fit"),
        ({"network": dataclasses.asdict(CONFIG) | {"colour": 1}}, "do not fit"),
    ],
)
def test_what_does_not_fit_is_refused(data, changes, message):
    with pytest.raises(BadInput, match=message):
        from_bytes(rewritten(data, **changes), "test/1", 6)


def test_a_decoder_of_other_tokens_is_refused(data):
    with pytest.raises(BadInput, match=r"tokens is .* train it again"):
        from_bytes(data, "da3-giant", 3072)


def test_weights_that_are_not_finite_are_refused():
    model = GravityViewDecoder(CONFIG)
    with torch.no_grad():
        model.out.weight[0, 0] = torch.nan
    with pytest.raises(BadInput, match=r"out\.weight holds values that are not finite"):
        from_bytes(to_bytes(model, None, None, {}), "test/1", 6)


def test_another_file_is_no_checkpoint():
    with pytest.raises(BadInput, match="no checkpoint of a gravity decoder"):
        from_bytes(b"something else entirely", "test/1", 6)


def test_a_file_is_found_by_its_digest_only(data, tmp_path):
    path = tmp_path / "decoder.safetensors"
    with pytest.raises(BadInput, match="No such file"):
        load_checkpoint(path, "test/1", 6)
    path.write_bytes(data)
    assert load_checkpoint(path, "test/1", 6, weights_digest(data)).digest == weights_digest(data)
    with pytest.raises(BadInput, match="not the expected"):
        load_checkpoint(path, "test/1", 6, "0" * 64)


def test_tokens_that_do_not_fit_are_refused(data):
    known = from_bytes(data, "test/1", 6)
    check_tokens(known, np.zeros((3, 6)))
    with pytest.raises(BadInput, match=r"\(views, 6\)"):
        check_tokens(known, np.zeros((3, 7)))
    tokens = np.zeros((3, 6))
    tokens[2, 1] = np.nan
    with pytest.raises(BadInput, match="token of view 2"):
        check_tokens(known, tokens)
