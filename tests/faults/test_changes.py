"""What a change reruns, with the real flow, keys and plan; only computations stand in.

Steps are keyed by whole modules: a changed function reruns the steps that reach its module.
"""

from __future__ import annotations

import importlib.metadata
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from flows import factorize, scene_geometry
from tasks.step import Step
from tests.faults.copied_packages import (
    ROOT,
    CopiedPackages,
    with_a_changed_function,
    with_other_words,
)
from tests.faults.reach import Reach, counts
from tests.faults.stand_in import all_steps

STEPS = all_steps()
OF_A_SCENE = {step.name for step in vars(factorize).values() if isinstance(step, Step)}
BY_A_MODEL = {step.name for step in vars(scene_geometry).values() if isinstance(step, Step)}
MUG, JAR = "mug a.png 5 5 40 40", "jar a.png 30 30 70 50"
BOXES = ("--box", *MUG.split(), "--box", *JAR.split())


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CopiedPackages]:
    packages = CopiedPackages(tmp_path_factory.mktemp("copy") / "house")
    yield packages
    packages.close()


@pytest.fixture(scope="module")
def reach(copy: CopiedPackages) -> dict[str, set[str]]:
    graph = Reach(copy.modules())
    return {name: graph.of(step.fn.__module__) for name, step in STEPS.items()}


def write_photos(folder: Path, shift: int = 0) -> Path:
    folder.mkdir()
    for i, name in enumerate("abc"):
        grey = np.full((60, 80, 3), 40 * i + shift, np.uint8)
        Image.fromarray(grey).save(folder / f"{name}.png")
    return folder


@pytest.fixture(scope="module")
def filled(copy: CopiedPackages, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two captures, and a store that holds all that came of both."""
    folder = tmp_path_factory.mktemp("filled")
    for shift, name in enumerate(("desk", "shelf")):
        write_photos(folder / name, shift)
        Scene(copy, folder, name).run()
    return folder


@pytest.fixture
def place(filled: Path, tmp_path: Path) -> Path:
    """A copy of that folder that a test may change."""
    return shutil.copytree(filled, tmp_path / "place")


class Scene:
    """One scene of a place: its plan, its run, by step and target."""

    def __init__(self, copy: CopiedPackages, place: Path, name: str = "desk", *more: str) -> None:
        self._copy = copy
        self._order = {
            "arguments": [str(place / name), *BOXES, *more],
            "store": str(place / "store"),
        }

    def plan(self) -> dict[str, Any]:
        return by_step(self._copy.ask("plan", **self._order))

    def run(self, *steady: str) -> dict[str, Any]:
        return by_step(self._copy.ask("run", **self._order, steady=list(steady)))


def by_step(entries: list[dict[str, Any]]) -> dict[str, Any]:
    return {f"{e['step']}[{e['label']}]" if e["label"] else e["step"]: e for e in entries}


def those(entries: dict[str, Any], did: str) -> set[str]:
    return {name for name, entry in entries.items() if entry["did"] == did}


def steps_of(names: set[str]) -> set[str]:
    return {name.partition("[")[0] for name in names}


def planned_and_done(desk: Scene, *steady: str) -> tuple[dict[str, Any], set[str]]:
    """Plan, then run; check that the plan named all that ran, with the reason."""
    plan = desk.plan()
    done = desk.run(*steady)
    executed = those(done, "executed")
    assert executed <= those(plan, "would run")
    for name in executed:
        if plan[name]["why"]["code"] != "upstream":
            assert plan[name]["why"] == done[name]["why"]
    return plan, executed


def test_a_finished_scene_has_nothing_to_do(copy: CopiedPackages, place: Path) -> None:
    plan, executed = planned_and_done(Scene(copy, place))
    assert steps_of(set(plan)) == OF_A_SCENE  # the stand-in leaves no step out
    assert those(plan, "cached") == set(plan)
    assert executed == set()


def test_comments_and_docstrings_of_all_modules_rerun_nothing(
    copy: CopiedPackages, place: Path
) -> None:
    files = copy.modules().values()
    with copy.edited({path: with_other_words(path.read_text("utf-8")) for path in files}):
        plan, executed = planned_and_done(Scene(copy, place))
    assert those(plan, "would run") == executed == set()


HELPERS = {
    "garden_models.geometry.rigid": None,
    "garden_models.segmentation.random_walk": {"segment"},
    "garden_models.meshing.field": {"mesh_object"},
    "garden_models.gravity.planes": {"align_gravity"},
    "garden_models.gravity.vanishing_points": {"align_gravity"},
    "garden_models.disentanglement.geometric_rule": None,
    "storage.formats.photos": {"ingest"},
    "storage.formats.png": set(),
    "flows.report.page": set(),
    "tasks.step.execute": set(),
    "tasks.simulate": {"simulate"},
}


@pytest.mark.parametrize("module", HELPERS)
def test_a_changed_helper_reruns_exactly_the_steps_that_reach_it(
    copy: CopiedPackages, place: Path, reach: dict[str, set[str]], module: str
) -> None:
    """The values stay equal here, so that nothing else may run."""
    reaching = {name for name in OF_A_SCENE if module in reach[name]}
    if HELPERS[module] is not None:
        assert reaching == HELPERS[module]
    path = copy.modules()[module]
    with copy.edited({path: with_a_changed_function(path.read_text("utf-8"))}):
        plan, executed = planned_and_done(Scene(copy, place))
    assert steps_of(executed) == reaching
    for name in executed:
        if plan[name]["why"]["code"] != "upstream":
            assert plan[name]["why"] == {"code": "code", "sentence": f"code changed ({module})"}


def changed_by(copy: CopiedPackages, module: str, before: dict[str, Any]) -> set[str]:
    path = copy.modules()[module]
    with copy.edited({path: with_a_changed_function(path.read_text("utf-8"))}):
        after = copy.ask("digests")
    return {name for name in before if after[name]["digest"] != before[name]["digest"]}


def check_modules(
    copy: CopiedPackages, reach: dict[str, set[str]], modules: list[str]
) -> dict[str, tuple[set[str], set[str]]]:
    before = copy.ask("digests")
    wrong = {}
    for module in modules:
        expected = {name for name, reached in reach.items() if module in reached}
        found = changed_by(copy, module, before)
        if found != expected:
            wrong[module] = (found, expected)
    return wrong


def test_a_sample_of_modules_counts_where_it_is_reached(
    copy: CopiedPackages, reach: dict[str, set[str]]
) -> None:
    modules = random.Random(0).sample(sorted(copy.modules()), 8)
    assert check_modules(copy, reach, modules) == {}


@pytest.mark.slow
def test_every_module_counts_exactly_where_it_is_reached(
    copy: CopiedPackages, reach: dict[str, set[str]]
) -> None:
    modules = sorted(copy.modules())
    assert sum(map(counts, modules)) > 100
    assert check_modules(copy, reach, modules) == {}


NOT_CALLED = {"clean_background": {"torch", "safetensors"}}
"""Libraries of modules that a step reaches by a registry of which it calls no entry."""


def test_a_library_that_a_step_reaches_counts_by_its_version(
    copy: CopiedPackages, reach: dict[str, set[str]]
) -> None:
    graph = Reach(copy.modules())
    owners = importlib.metadata.packages_distributions()
    # Annotations, and a hash by which weights are found.
    no_result = set(sys.stdlib_module_names) | {"jaxtyping", "blake3"}
    missing = {}
    for name in OF_A_SCENE | BY_A_MODEL:
        declared = {normal(package) for package in STEPS[name].spec.packages}
        libraries = graph.libraries(reach[name]) - no_result - NOT_CALLED.get(name, set())
        left = {n for n in libraries if not declared & {normal(o) for o in owners.get(n, [n])}}
        if left:
            missing[name] = sorted(left)
    assert missing == {}


def normal(distribution: str) -> str:
    return distribution.lower().replace("_", "-")


def test_what_a_step_loads_when_it_runs_counts(reach: dict[str, set[str]]) -> None:
    code = """if True:
        import sys
        from tasks.align_gravity import align_gravity
        from garden_models.gravity.config import AlignGravity
        before = set(sys.modules)
        from tests.garden_models.gravity.synthetic_room import Room, make_room
        align_gravity.fn(make_room(Room())[0], AlignGravity())
        print(*(m for m in set(sys.modules) - before if m.startswith("garden_models.gravity")))
    """
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    loaded = set(done.stdout.split())
    assert "garden_models.gravity.planes" in loaded
    assert loaded <= reach["align_gravity"]
    assert loaded <= set(STEPS["align_gravity"].code().modules)


def test_a_changed_photo_reruns_its_scene_and_no_other(copy: CopiedPackages, place: Path) -> None:
    Image.fromarray(np.full((60, 80, 3), 200, np.uint8)).save(place / "desk" / "b.png")
    plan, executed = planned_and_done(Scene(copy, place))
    assert plan["ingest"]["why"] == {"code": "input", "sentence": "photo b.png changed"}
    assert plan["register"]["why"] == {"code": "upstream", "sentence": "ingest would run first"}
    assert executed == set(plan)
    other, executed = planned_and_done(Scene(copy, place, "shelf"))
    assert those(other, "cached") == set(other)
    assert executed == set()


def test_a_photo_saved_again_with_equal_pixels_stops_there(
    copy: CopiedPackages, place: Path
) -> None:
    path = place / "desk" / "b.png"
    before = path.read_bytes()
    Image.open(path).save(path, compress_level=0)
    assert path.read_bytes() != before
    plan, executed = planned_and_done(Scene(copy, place))
    assert plan["ingest"]["why"]["sentence"] == "photo b.png changed"
    assert executed == {"ingest"}


def test_an_upstream_rerun_with_equal_content_stops_there(
    copy: CopiedPackages, place: Path
) -> None:
    """A steady reconstruction comes out as before whatever its settings are."""
    Scene(copy, place, "desk", "--set", "reconstruct.long_side=300").run("reconstruct")
    more = ("--set", "reconstruct.long_side=320")
    plan, executed = planned_and_done(Scene(copy, place, "desk", *more), "reconstruct")
    assert executed == {"reconstruct"}
    assert plan["reconstruct"]["why"]["code"] == "config"
    assert "reconstruct would run first" in plan["align_gravity"]["why"]["sentence"]
    more = ("--set", "reconstruct.long_side=340")
    _plan, executed = planned_and_done(Scene(copy, place, "desk", *more))
    assert executed > {"reconstruct", "align_gravity", "segment[mug]", "render"}


@pytest.mark.slow
@pytest.mark.parametrize(
    "environment",
    [
        {"PYTHONHASHSEED": "1"},
        {"PYTHONHASHSEED": "2"},
        {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        {"OMP_NUM_THREADS": "3", "MKL_NUM_THREADS": "3", "OPENBLAS_NUM_THREADS": "3"},
        {
            "GARDEN_TEST_MACHINE": "elsewhere.example",
            "HOME": "/nowhere/home",
            "USER": "somebody",
            "TZ": "Asia/Kathmandu",
            "LC_ALL": "C",
            "LANG": "de_DE.UTF-8",
            "PYTHONUTF8": "0",
            "TMPDIR": "/var/tmp",
        },
    ],
    ids=["seed 1", "seed 2", "1 thread", "3 threads", "another machine"],
)
def test_the_same_keys_anywhere(
    copy: CopiedPackages, place: Path, tmp_path: Path, environment: dict[str, str]
) -> None:
    """Another process, folder of the sources, capture and store, besides the environment."""
    here = {name: entry["ref"]["key"] for name, entry in Scene(copy, place).plan().items()}
    elsewhere = CopiedPackages(tmp_path / "other" / "sources", **environment)
    moved = shutil.copytree(place, tmp_path / "moved")
    try:
        plan = Scene(elsewhere, moved).plan()
        assert {name: entry["ref"]["key"] for name, entry in plan.items()} == here
        assert those(plan, "cached") == set(plan)
        shutil.rmtree(moved / "store")
        afresh = Scene(elsewhere, moved).run()
        assert {name: entry["ref"]["key"] for name, entry in afresh.items()} == here
    finally:
        elsewhere.close()
