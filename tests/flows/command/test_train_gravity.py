"""``garden train gravity``: what it needs, and how it says so."""

from __future__ import annotations

import pytest

from flows.command import EXIT_WRONG_USE, main
from flows.training.gravity_tokens import token_data
from garden_models.scene import BadInput


def test_the_paper_preset_asks_for_data_and_backbone(tmp_path, capsys):
    code = main(["train", "gravity", "--preset", "paper", "--store", str(tmp_path / "store")])
    assert code == EXIT_WRONG_USE
    assert "--backbone" in capsys.readouterr().err


def test_a_backbone_without_weights_is_refused(tmp_path, capsys):
    words = ["train", "gravity", "--preset", "paper", "--backbone", str(tmp_path)]
    assert main([*words, "--store", str(tmp_path / "store")]) == EXIT_WRONG_USE
    assert "no model.safetensors" in capsys.readouterr().err


def test_data_sets_are_given_by_name_and_folder(tmp_path):
    (tmp_path / "model.safetensors").write_bytes(b"")
    found = token_data(tmp_path, ["tartanair=/data/t", "hypersim=/data/h"], "cpu")
    assert [name for name, _ in found.datasets] == ["tartanair", "hypersim"]
    for given, message in (([], "no data set"), (["/data/t"], "NAME=FOLDER")):
        with pytest.raises(BadInput, match=message):
            token_data(tmp_path, given, "cpu")
