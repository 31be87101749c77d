"""Options come from a preset, a TOML file and single settings; a typo is an error."""

from __future__ import annotations

from pathlib import Path

import pytest

from flows.licence import models_of
from flows.preset import Preset, read_preset
from garden_models.physics.config import ITERATIONS, TIMESTEP
from garden_models.scene import BadInput


def test_the_embedded_preset_has_the_papers_simulation() -> None:
    assert read_preset("embedded", []).simulation.seconds == 10
    assert (TIMESTEP, ITERATIONS) == (0.001, 50)


def test_a_setting_changes_one_option_and_nothing_else() -> None:
    preset = read_preset("embedded", ["simulation.seconds=2"])
    assert preset.simulation.seconds == 2.0
    assert preset.reconstruct == Preset().reconstruct


def test_a_toml_file_changes_options(tmp_path: Path) -> None:
    path = tmp_path / "quick.toml"
    path.write_text("[simulation]\nseconds = 1\n")
    assert read_preset(str(path), []).simulation.seconds == 1.0


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("simulation.second=2", "no option second"),
        ("simulate.seconds=2", "no step called simulate"),
        ("simulation.seconds=fast", "must be of type float"),
        ("seconds", "STEP.OPTION=VALUE"),
    ],
)
def test_a_wrong_setting_says_what_there_is(setting: str, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        read_preset("embedded", [setting])


def test_an_unknown_preset_names_the_known_ones() -> None:
    with pytest.raises(BadInput, match="embedded"):
        read_preset("fancy", [])


def test_foundation_is_the_papers_models() -> None:
    models = ("depth_anything_3", "sam3", "sam3d_objects", "foundation_pose")
    assert models_of(read_preset("foundation", [])) == models


def test_foundation_with_single_steps_changed_back(tmp_path: Path) -> None:
    path = tmp_path / "mixed.toml"
    path.write_text('preset = "foundation"\n[mesh]\nmethod = "fusion"\n')
    mixed = read_preset(str(path), ["place.method=render_and_compare", "segment.method=sam2"])
    assert models_of(mixed) == ("depth_anything_3", "sam2")
    assert mixed.mesh == Preset().mesh
    assert mixed.place == Preset().place


def test_a_model_in_the_wrong_step_is_an_error() -> None:
    with pytest.raises(BadInput, match=r"segment\.method must be one of"):
        read_preset("foundation", ["segment.method=sam3d_objects"])
