"""Options come from a preset, a TOML file and single settings; a typo is an error."""

from __future__ import annotations

from pathlib import Path

import pytest

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
