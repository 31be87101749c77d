"""The recipes of the models' own environments: pinned, linted, and complete for the adapters."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.register import HOME
from garden_models import foundation
from tasks.step.code import code_of, module_path
from tests.deploy.test_images import PINNED, tool

RECIPES = sorted((HOME / "deploy" / "environments").iterdir())
NAMES = [recipe.name for recipe in RECIPES]
PIN = re.compile(r"[A-Za-z0-9_.-]+(\[[a-z,]+\])?==[0-9][\w.+]*")
DISTRIBUTIONS = {"cv2": "opencv-python-headless", "PIL": "pillow", "skimage": "scikit-image"}
OURS = {"garden_models", "tasks", "storage"}

each_recipe = pytest.mark.parametrize("recipe", RECIPES, ids=NAMES)


def requirements(recipe: Path) -> list[str]:
    lines = (recipe / "requirements.txt").read_text().splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def distributions(recipe: Path) -> set[str]:
    return {re.split(r"[=\[]", line)[0].lower() for line in requirements(recipe)}


def dockerfile(recipe: Path) -> str:
    return (recipe / "Dockerfile").read_text()


def test_every_model_of_the_paper_that_needs_its_own_has_one() -> None:
    assert NAMES == [
        "depth_anything_3", "foundation_pose", "geocalib", "pi3", "sam3", "sam3d_objects", "vggt",
    ]  # fmt: skip


@each_recipe
def test_it_passes_hadolint(recipe: Path) -> None:
    assert (
        subprocess.run([tool("hadolint"), str(recipe / "Dockerfile")], check=False).returncode == 0
    )


@each_recipe
def test_everything_is_pinned(recipe: Path) -> None:
    for line in requirements(recipe):
        assert PIN.fullmatch(line), line
    assert len(distributions(recipe)) == len(requirements(recipe))
    text = dockerfile(recipe)
    base = re.search(r"^FROM (\S+)$", text, re.MULTILINE)
    assert base is not None
    assert PINNED.match(base[1])
    for name, value in re.findall(r"^ARG (\w+)=(\S+)$", text, re.MULTILINE):
        if name in ("TORCH_INDEX", "KAOLIN_LINKS"):
            assert value == '""', "where packages come from is for who builds"
            continue
        assert re.fullmatch(r"[0-9a-f]{40}|v[0-9.]+", value), name
    for url in re.findall(r"(?:git\+)?https://github\.com/\S+", text):
        assert "${" in url, f"{url} names no commit"


@each_recipe
def test_a_worker_can_run_in_it(recipe: Path) -> None:
    assert {"numpy", "jaxtyping"} <= distributions(recipe)
    version = re.search(r"python:?3\.(\d+)", dockerfile(recipe))
    assert version is not None
    assert int(version[1]) >= 10
    assert re.search(r"^USER 10001$", dockerfile(recipe), re.MULTILINE), "it must not be root"


@each_recipe
def test_torchvision_is_there_only_beside_the_torch_that_it_was_built_for(recipe: Path) -> None:
    pins = dict(line.split("==") for line in requirements(recipe))
    torch, vision = pins["torch"], pins.get("torchvision")
    if vision is None:
        return
    assert torch.partition("+")[2] == vision.partition("+")[2]
    assert torch.startswith("2.")
    minor = int(torch.split(".")[1]) + 15
    assert vision.split(".")[1] == str(minor), "torch 2.N goes with torchvision 0.(N+15)"


def third_party(module: str) -> set[str]:
    """Return the top-level names of all that a module and what it reaches import at once."""
    found: set[str] = set()
    for name in code_of(module).modules:
        path = module_path(name)
        if path is None:
            continue
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.Import):
                found |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found.add((node.module or "").partition(".")[0])
    return found - OURS - set(sys.stdlib_module_names)


@pytest.mark.parametrize("name", [n for n in foundation.ADAPTERS if n in NAMES])
def test_it_has_what_the_adapter_and_the_model_import(name: str) -> None:
    recipe = RECIPES[NAMES.index(name)]
    text = dockerfile(recipe).lower().replace("-", "_")
    for module in third_party(foundation.ADAPTERS[name]) | set(foundation.card(name).imports):
        distribution = DISTRIBUTIONS.get(module, module).lower()
        spellings = {distribution, distribution.replace("_", "-"), f"{distribution}-core"}
        spellings |= {f"{distribution}-lang"}
        assert spellings & distributions(recipe) or module.lower() in text, module
