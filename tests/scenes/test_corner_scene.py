"""The whole pipeline on the sample capture, through the command, Prefect and the store."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from flows.benchmark.sample import Measure, measure_sample
from flows.command import main
from flows.package.frames import ZUP_FROM_GV
from flows.report.values import SceneValues, load_values
from flows.scene_run import SceneRequest, plan_scene
from storage import Store
from tasks.step import RunContext, run_context
from tests.scenes.corner_truth import CORNER, load_corner
from tests.vlm_server import KEY, KEY_VARIABLE, MODEL, Reply, VlmServer, targets_json

SCENE_STEPS = {"clean_background", "compose", "simulate", "render"}

pytestmark = pytest.mark.slow


@dataclass
class Run:
    """One run of the command on a copy of the sample capture."""

    folder: Path
    code: int
    report: dict[str, Any]

    def again(self, *arguments: str) -> Run:
        """Run the same command again, with more arguments."""
        return factorize(self.folder, *arguments)

    @property
    def package(self) -> Path:
        return self.folder / "scenes" / "corner"

    @property
    def executed(self) -> set[tuple[str, str | None]]:
        steps = self.report["steps"]
        return {(s["step"], s["target"]) for s in steps if s["outcome"] == "executed"}


def factorize(folder: Path, *arguments: str) -> Run:
    code = main(
        ["factorize", str(folder / "corner"), "--store", str(folder / "store"),
         "--out", str(folder / "scenes"), *arguments]
    )  # fmt: skip
    report = json.loads((folder / "scenes" / "corner" / "report.json").read_text())
    return Run(folder, code, report)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, prefect_server: str) -> Iterator[Run]:
    folder = tmp_path_factory.mktemp("corner-scene")
    (folder / "corner").mkdir()
    shutil.copytree(CORNER / "images", folder / "corner" / "images")
    shutil.copy(CORNER / "targets.json", folder / "corner")
    yield factorize(folder)
    shutil.rmtree(folder)


@pytest.fixture(scope="module")
def values(run: Run) -> SceneValues:
    from flows.capture import find_capture
    from flows.preset import Preset
    from garden_models.targets.boxes import parse_targets

    capture = find_capture(run.folder / "corner", None)
    targets = parse_targets(json.loads((run.folder / "corner" / "targets.json").read_text()))
    store = Store.open(run.folder / "store")
    request = SceneRequest("corner", capture.source, targets, Preset(), run.package)
    result, plan = plan_scene(request, store)
    assert {entry.action for entry in plan} == {"cached"}
    with run_context(RunContext(store=store, scene="corner")):
        return load_values(result)


def test_every_photo_is_registered_and_the_exit_code_follows_the_verdict(run: Run) -> None:
    assert run.report["photos"]["registered"] == run.report["photos"]["given"] == 24
    assert run.code == {"ok": 0, "degraded": 3}[run.report["status"]]
    assert (run.report["status"] == "ok") == (not run.report["reasons"])


@pytest.mark.parametrize("what", ["camera rotation", "depth error", "gravity", "jar"])
def test_measures_against_the_exact_truth(values: SceneValues, what: str) -> None:
    measures = [m for m in measure_sample(values, load_corner()) if m.name.startswith(what)]
    assert measures
    assert all(m.holds for m in measures), "\n".join(m.line() for m in measures)


def test_a_measure_that_misses_its_limit_says_so() -> None:
    assert not Measure("gravity", 0.9, 0.7, "deg").holds
    assert Measure("mask IoU", 0.95, 0.9, "", at_least=True).holds
    assert "MISS" in Measure("gravity", 0.9, 0.7, "deg").line()


def test_the_package_is_complete_and_opens_in_the_programs_it_is_for(run: Run) -> None:
    model = mujoco.MjModel.from_xml_path(str(run.package / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("settled").id)
    start = data.qpos.copy()
    mujoco.mj_step(model, data, nstep=1000)
    assert np.abs(data.qpos - start)[:3].max() < 0.005
    np.testing.assert_allclose(model.opt.gravity, [0, 0, -9.81], atol=1e-9)
    for name in ("scene.glb", "background/points.ply", "background/splat.ply", "report.html",
                 "cameras/transforms.json", "timings.parquet", "LICENSES.json"):  # fmt: skip
        assert (run.package / name).stat().st_size > 0, name


def test_frames_agree_with_each_other(run: Run) -> None:
    frames = json.loads((run.package / "frames.json").read_text())["frames"]
    gv_from_world = np.array(frames["world"]["gv_from_world"])
    down_gv = gv_from_world[:3, :3] @ np.array(run.report["gravity"]["direction_world"])
    np.testing.assert_allclose(down_gv, [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(frames["zup"]["zup_from_gv"], ZUP_FROM_GV, atol=1e-12)
    for name, frame in frames.items():
        both = np.array(frame[f"gv_from_{name}"]) @ np.array(frame[f"{name}_from_gv"])
        np.testing.assert_allclose(both, np.eye(4), atol=1e-9)


def test_the_report_stands_alone(run: Run) -> None:
    page = (run.package / "report.html").read_text()
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "https://" not in page
    for target in ("house", "duck", "jar"):
        assert f"<h2>{target} " in page


def test_every_step_says_why_and_what_it_cost(run: Run) -> None:
    for step in run.report["steps"]:
        assert step["why"]
        assert step["backend"]
        assert step["outcome"] == "executed"
        assert set(step["seconds"]) == {"load", "compute", "publish", "wait"}


def test_a_rerun_executes_nothing(run: Run) -> None:
    again = run.again()
    assert again.executed == set()
    assert again.code == run.code
    assert {step["outcome"] for step in again.report["steps"]} == {"cached"}


def test_another_box_reruns_only_that_target_and_what_joins_the_targets(run: Run) -> None:
    """The others only look whether the new box claims any of their points."""
    document = json.loads((run.folder / "corner" / "targets.json").read_text())
    jar = next(t for t in document["targets"] if t["name"] == "jar")
    jar["box"] = [jar["box"][0] + 2, jar["box"][1] + 2, jar["box"][2] - 2, jar["box"][3] - 2]
    changed = run.folder / "changed.json"
    changed.write_text(json.dumps(document))
    again = run.again("--targets", str(changed))
    assert ("segment", "jar") in again.executed
    for step, target in again.executed - {("find_rivals", "duck"), ("find_rivals", "house")}:
        assert step in SCENE_STEPS or target == "jar"


def test_a_model_that_proposes_the_same_boxes_reruns_nothing(
    run: Run, vlm: VlmServer, capsys: pytest.CaptureFixture[str]
) -> None:
    document = json.loads((run.folder / "corner" / "targets.json").read_text())
    photos = sorted(path.name for path in (run.folder / "corner" / "images").iterdir())
    said = targets_json(*(
        (t["name"], f"P{1 + photos.index(t['image'])}", t["box"]) for t in document["targets"]
    ))  # fmt: skip
    vlm.say(said, said, Reply(status=401, body=KEY.encode()))
    asked = {"address": vlm.url, "key_variable": KEY_VARIABLE, "boxes": "xyxy_px", "max_photos": 24}
    settings = [word for k, v in asked.items() for word in ("--set", f"propose.{k}={v}")]
    place = run.folder / "proposed"

    def propose(goal: str) -> tuple[int, Run]:
        more = ("--propose", MODEL, "--goal", goal, *settings, "--out", str(place))
        code = main(
            ["factorize", str(run.folder / "corner"), "--store", str(run.folder / "store"), *more]
        )
        report = json.loads((place / "corner" / "report.json").read_text())
        return code, Run(place, code, report)

    code, proposed = propose("build a tower")
    assert proposed.executed == {("propose_targets", None), ("check_targets", None)}
    assert code == run.code
    assert proposed.report["proposal"]["goal"] == "build a tower"
    assert [o["box"] for o in proposed.report["objects"]] == [
        o["box"] for o in run.report["objects"]
    ]
    targets = json.loads((place / "corner" / "targets.json").read_text())
    assert [t["box"] for t in targets["targets"]] == [t["box"] for t in document["targets"]]

    code, refused = propose("knock it over")
    assert (code, refused.executed) == (1, set())
    assert f"refused the key in {KEY_VARIABLE}" in refused.report["reasons"][0]
    code, again = propose("build a tower")
    assert (code, again.executed, len(vlm.asked)) == (run.code, set(), 3)

    said_aloud = "".join(capsys.readouterr())
    files = [p.read_bytes() for p in run.folder.rglob("*") if p.is_file()]
    assert not any(KEY.encode() in data for data in [*files, said_aloud.encode()])


def test_the_store_is_sound_and_explains_itself(
    run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    store = ["--store", str(run.folder / "store")]
    assert main(["store", "verify", *store]) == 0
    capsys.readouterr()
    assert main(["why", "mesh_object[duck]", "--json", *store]) == 0
    chain = [entry["step"] for entry in json.loads(capsys.readouterr().out)["chain"]]
    assert chain[0] == "mesh_object"
    assert {"segment", "align_gravity", "reconstruct", "register", "ingest"} <= set(chain)
