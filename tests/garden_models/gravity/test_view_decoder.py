"""The decoder as a cue: its claim is calibrated, what is strange is told, no shipped one needed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from garden_models.gravity import METHODS, read_cue, view_decoder
from garden_models.gravity.align import align_gravity
from garden_models.gravity.config import AlignGravity
from garden_models.gravity.decoder.checkpoint import to_bytes
from garden_models.gravity.decoder.familiarity import Familiarity
from garden_models.gravity.decoder.shipped import checkpoint_file
from garden_models.gravity.decoder.token_layout import TOKEN_WIDTH
from garden_models.gravity.decoder.uncertainty import Calibration
from garden_models.gravity.evaluation.conditions import GIVEN
from garden_models.gravity.evaluation.methods import DecoderWeights, run_methods, table_methods
from garden_models.gravity.evaluation.procedural import procedural_truth
from garden_models.gravity.training.config import GravityOptimisation, embedded_network
from garden_models.gravity.training.optimise import start, trained_model
from garden_models.scene import BadInput
from tests.garden_models.gravity.synthetic_room import Room, cameras_only

CALIBRATION = Calibration((-3.0, -1.0), (-2.5, -0.5), 0.05)


def weights(limit: float = 100.0) -> bytes:
    network = embedded_network(16, 1, 2, 16, 16)
    model = trained_model(start(network, GravityOptimisation(threads=1)), network)
    familiar = Familiarity((0.0,) * TOKEN_WIDTH, (1.0,) * TOKEN_WIDTH, limit)
    return to_bytes(model, CALIBRATION, familiar, {})


@pytest.fixture(scope="module")
def truth():
    return procedural_truth("test", 1, GIVEN)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "decoder.safetensors"
    path.write_bytes(weights())
    return path


def test_the_cue_states_a_direction_and_how_often_it_fails(truth, file):
    cue = read_cue("view_decoder", truth.reconstruction, str(file))
    (mode,) = cue.modes
    assert mode.probability == pytest.approx(1 - CALIBRATION.spoilt)
    assert 0 < mode.sigma_deg < 90
    down = cue.alone().down_world
    assert cue.down_log_odds(down) > 0 > cue.down_log_odds(-down)


def test_what_is_strange_is_flagged_and_trusted_less(truth, tmp_path):
    path = tmp_path / "decoder.safetensors"
    path.write_bytes(weights(limit=1e-3))
    (mode,) = read_cue("view_decoder", truth.reconstruction, str(path)).modes
    assert mode.probability <= 0.4
    assert "unlike what it learned from" in mode.note


def test_an_untrained_decoder_does_not_overrule_the_planes(truth, file):
    methods = ("planes", "vanishing_points", "camera_x_axes")
    without = align_gravity(truth.reconstruction, AlignGravity(methods))
    config = AlignGravity((*methods, "view_decoder"), decoder_weights=str(file))
    found = align_gravity(truth.reconstruction, config)
    assert {e.method for e in found.evidence} >= {"view_decoder"}
    assert found.down_world @ without.down_world > np.cos(np.radians(2))


def test_without_surfaces_and_lines_it_says_nothing(file):
    reconstruction, _ = cameras_only(Room(photos=3))
    assert read_cue("view_decoder", reconstruction, str(file)) is None


@pytest.mark.skipif(checkpoint_file() is not None, reason="a decoder is shipped")
def test_without_a_checkpoint_it_says_how_to_get_one(truth):
    with pytest.raises(BadInput, match="garden train gravity"):
        METHODS["view_decoder"](truth.reconstruction)


def test_scaled_cameras_are_refused(truth, file):
    view = truth.reconstruction.views[0]
    scaled = dataclasses.replace(view, camera_from_world=view.camera_from_world * 1000)
    wrong = dataclasses.replace(
        truth.reconstruction, views=(scaled, *truth.reconstruction.views[1:])
    )
    with pytest.raises(BadInput, match="without scale"):
        view_decoder.read(wrong, str(file))


def test_the_table_holds_ours_and_every_baseline(truth):
    found = run_methods(table_methods(DecoderWeights(weights())), truth.reconstruction)
    assert found.methods[:3] == ("ours, fused", "decoder alone", "classical cues fused")
    assert "GeoCalib" not in found.methods
    assert len(table_methods(DecoderWeights())) == len(found.methods) - 2
    classical = found.down_world[2]
    assert np.linalg.norm(classical) == pytest.approx(1)
