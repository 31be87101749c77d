"""What a machine's settings of its models mean, and how mistakes in them are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from garden_models.scene import BadInput
from tasks.model.settings import device_of, model_settings, settings_file


def write(text: str) -> None:
    settings_file().parent.mkdir(parents=True, exist_ok=True)
    settings_file().write_text(text)


def test_without_a_file_each_model_has_its_own_folder_and_runs_here(
    models: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = model_settings("doubler")
    assert settings.weights == models / "doubler"
    assert (settings.python, settings.memory_limit_gb, settings.dtype) == (None, None, "float32")
    monkeypatch.delenv("GARDEN_WEIGHTS")
    assert model_settings("doubler").weights == tmp_path / "cache/garden/weights/doubler"


def test_a_table_says_what_differs_and_its_paths_are_relative_to_the_file(models: Path) -> None:
    write(
        '[doubler]\nweights = "w/d"\npython = "env/bin/python"\ntime_limit_s = 90\n'
        'memory_limit_gb = 2.5\ndtype = "bfloat16"\ndevice = "cpu"'
    )
    settings = model_settings("doubler")
    folder = settings_file().parent
    assert settings.weights == folder / "w/d"
    assert settings.python == (str(folder / "env/bin/python"),)
    assert (settings.time_limit_s, settings.memory_limit_gb) == (90.0, 2.5)
    assert (settings.dtype, settings.device) == ("bfloat16", "cpu")
    assert model_settings("tripler").weights == models / "tripler"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[doubler\n", "cannot be read as TOML"),
        ("[nobody]\n", "no model is called 'nobody'"),
        ("doubler = 3\n", r"below \[doubler\]"),
        ("[doubler]\ncolour = 1\n", "doubler.colour is no option; there are weights"),
        ("[doubler]\ntime_limit_s = -1\n", "doubler.time_limit_s must be a positive number"),
        ('[doubler]\nmemory_limit_gb = "8"\n', "memory_limit_gb must be a positive number"),
        ("[doubler]\ntime_limit_s = true\n", "time_limit_s must be a positive number"),
        ("[doubler]\nweights = 3\n", "doubler.weights must be a path"),
        ("[doubler]\npython = []\n", "doubler.python must be the path of a Python, or a list"),
        ('[doubler]\ndtype = "int4"\n', "dtype must be one of float32, bfloat16"),
        ('[doubler]\ndevice = "tpu"\n', "doubler runs on cpu or cuda, not on 'tpu'"),
        ('[tripler]\ndevice = "cuda:1"\n', "tripler runs on cpu, not on 'cuda:1'"),
        ('[tripler]\ndtype = "bfloat16"\n', "tripler runs in float32 only"),
    ],
)
def test_a_mistake_is_named_with_its_file(models: Path, text: str, said: str) -> None:
    write(text)
    with pytest.raises(BadInput, match=said) as caught:
        model_settings("tripler" if text.startswith("[tripler") else "doubler")
    assert str(settings_file()) in str(caught.value)


def test_a_file_that_is_asked_for_must_be_there(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GARDEN_MODELS", "/nowhere/models.toml")
    with pytest.raises(BadInput, match=r"/nowhere/models.toml \(\$GARDEN_MODELS\)"):
        model_settings("doubler")


def test_a_gpu_that_is_not_there_is_not_replaced_in_silence(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")
    assert device_of("doubler", model_settings("doubler")) == "cpu"
    write('[doubler]\ndevice = "cuda"\n')
    with pytest.raises(BadInput, match="set to run on cuda, and this machine has no GPU"):
        device_of("doubler", model_settings("doubler"))
