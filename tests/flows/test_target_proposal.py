"""Proposed targets in the real flow: what fails there costs nothing else. Computations but the
proposal's stand in; the model's server is real.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flows.command import EXIT_OF_STATUS, main
from flows.preset import Preset
from flows.report.document import scene_verdict
from flows.scene_request import SceneOptions, read_scene
from flows.scene_run import SceneRequest, SceneResult, is_finished, plan_scene, run_scene
from garden_models.scene import BadGeometry, Target
from garden_models.targets.config import ProposeTargets
from storage import Store
from tasks.reconstruct import reconstruct
from tests.faults.stand_in import all_steps, sample_of
from tests.flows.benchmark.latency.filled_store import capture
from tests.vlm_server import KEY, KEY_VARIABLE, Reply, VlmServer, targets_json

GOOD = targets_json(("mug", "P1", [300, 100, 700, 200]), ("chair", "P2", [100, 500, 900, 800]))
BEFORE = ("ingest", "register", "reconstruct", "align_gravity")
PROPOSING = ("propose_targets", "check_targets")
EACH = ("segment", "mesh_object", "place_object", "label_points")
AFTER = ("clean_background", "compose", "simulate", "render")


@pytest.fixture(autouse=True)
def stand_ins(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for step in all_steps().values():
        if step.name not in ("ingest", *PROPOSING):
            noun = step.hints()["return"]
            monkeypatch.setattr(step, "spec", replace(step.spec, isolated=False))
            monkeypatch.setattr(step, "fn", sample_of(step, noun))
    yield


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store.open(tmp_path / "store", durability="none")


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    return capture(tmp_path / "desk")


def request(photos: Path, config: ProposeTargets, **changes: Any) -> SceneRequest:
    preset = replace(Preset(), propose=replace(config, **changes))
    return read_scene(SceneOptions(photos, photos.parent / "scenes", preset))


def run(wanted: SceneRequest, store: Store) -> tuple[SceneResult, dict[str, set[str]]]:
    """Run a scene; return its result, and the names of the steps by what became of them."""
    result = run_scene(wanted, store, lambda _event: None, "local")
    did: dict[str, set[str]] = {}
    for event in result.outcomes:
        did.setdefault(str(event.outcome), set()).add(event.step)
    return result, did


def test_the_scene_goes_on_with_what_was_proposed(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD, GOOD)
    wanted = request(photos, vlm_config)
    result, did = run(wanted, store)
    assert [(t.name, t.photo) for t in result.refs.targets] == [
        ("mug", "a.jpg"),
        ("chair", "b.jpg"),
    ]
    assert result.refs.targets[0].box == (6.0, 12.0, 12.0, 28.0)  # of 60 x 40 pixels
    assert did["executed"] >= {*BEFORE, *PROPOSING, *EACH, *AFTER}
    assert {e.label for e in result.outcomes if e.step == "segment"} == {"mug", "chair"}
    assert set(run(wanted, store)[1]) == {"cached"}
    assert len(vlm.asked) == 2


@pytest.mark.slow
def test_prefect_runs_both_queries_as_tasks(
    prefect_server: str, photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD, GOOD, Reply(status=401))
    wanted = request(photos, vlm_config)
    result = run_scene(wanted, store, lambda _event: None, "prefect")
    assert {e.step for e in result.outcomes} >= {*BEFORE, *PROPOSING, *EACH, *AFTER}
    assert len(result.refs.targets) == 2
    result = run_scene(
        request(photos, vlm_config, attempt=2), store, lambda _event: None, "prefect"
    )
    assert result.refs.failure is not None
    assert "refused the key" in result.refs.failure.reason


@pytest.mark.parametrize(
    ("replies", "words"),
    [
        ([Reply(status=401)], f"refused the key in {KEY_VARIABLE}"),
        ([Reply(status=429)] * 3, "takes no more requests for now"),
        ([Reply(delay_s=1.5)] * 3, "did not answer within 0.3 s"),
        ([Reply("")], "gave an empty answer"),
        (['{"targets": []}'], "proposed no target that can be used"),
        ([GOOD, Reply(status=403)], f"refused the key in {KEY_VARIABLE}"),
    ],
)
def test_a_proposal_that_fails_is_one_sentence_and_costs_no_other_step(
    replies: list[Reply | str],
    words: str,
    photos: Path,
    vlm: VlmServer,
    vlm_config: ProposeTargets,
    store: Store,
) -> None:
    wanted = request(photos, vlm_config, timeout_s=0.3)
    vlm.say(*replies)
    result, did = run(wanted, store)
    assert result.refs.failure is not None
    verdict = scene_verdict(result)
    assert EXIT_OF_STATUS[verdict.status] == 1
    assert len(verdict.reasons) == 1
    assert words in verdict.reasons[0]
    assert did["executed"] - {"propose_targets"} == set(BEFORE)
    assert len(vlm.asked) == len(replies)

    vlm.say(*[GOOD] * (3 - len(replies) if replies[0] == GOOD else 2))
    result, did = run(wanted, store)
    assert result.refs.failure is None
    assert did["cached"] >= set(BEFORE)
    assert not did["executed"] & set(BEFORE)
    assert ("propose_targets" in did["cached"]) == (replies[0] == GOOD)


def test_an_answer_on_its_way_is_kept_when_something_else_fails(
    photos: Path,
    vlm: VlmServer,
    vlm_config: ProposeTargets,
    store: Store,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(**_arguments: Any) -> Any:
        raise BadGeometry("the photos show nothing")

    fail.__module__ = reconstruct.fn.__module__
    vlm.say(Reply(GOOD, delay_s=0.3), Reply(GOOD, delay_s=0.3))
    with monkeypatch.context() as patch:
        patch.setattr(reconstruct, "fn", fail)
        result, did = run(request(photos, vlm_config), store)
    assert result.refs.failure is not None
    assert result.refs.failure.step == "reconstruct"
    assert did["executed"] >= set(PROPOSING)
    _result, did = run(request(photos, vlm_config), store)
    assert did["cached"] >= set(PROPOSING)
    assert len(vlm.asked) == 2


def test_another_goal_that_fails_takes_nothing_from_what_was_there(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD, GOOD, Reply(status=401))
    run(request(photos, vlm_config), store)
    result, _did = run(request(photos, vlm_config, goal="all of it falls"), store)
    assert result.refs.failure is not None
    assert set(run(request(photos, vlm_config), store)[1]) == {"cached"}


def test_another_answer_reruns_the_objects_that_it_changes(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD, GOOD)
    run(request(photos, vlm_config), store)
    moved = targets_json(("mug", "P1", [300, 100, 700, 300]), ("chair", "P2", [100, 500, 900, 800]))
    vlm.say(moved, moved)
    result, _did = run(request(photos, vlm_config, attempt=2), store)
    segmented = {e.label: e.outcome for e in result.outcomes if e.step == "segment"}
    assert segmented["mug"] == "executed"


def test_a_plan_says_what_waits_for_the_proposal(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    wanted = request(photos, vlm_config)
    result, plan = plan_scene(wanted, store)
    assert [e.step for e in plan if e.why.code != "upstream"] == ["ingest"]
    vlm.say(Reply(status=401))
    run(wanted, store)
    result, plan = plan_scene(wanted, store)
    actions = {e.step: (e.action, e.why.sentence) for e in plan}
    assert {step for step, (action, _) in actions.items() if action == "cached"} == set(BEFORE)
    assert actions["segment"] == ("would run", "check_targets would run first")
    assert set(actions) == {*BEFORE, *PROPOSING, *EACH, *AFTER}
    assert not is_finished(plan, result)
    vlm.say(GOOD, GOOD)
    run(wanted, store)
    result, plan = plan_scene(wanted, store)
    assert {e.action for e in plan} == {"cached"}
    assert {e.label for e in plan if e.step == "segment"} == {"mug", "chair"}
    assert len(vlm.asked) == 3


def test_without_a_check_the_proposal_is_taken_as_it_is(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD)
    result, did = run(request(photos, vlm_config, critic=False), store)
    assert len(result.refs.targets) == 2
    assert "check_targets" not in did["executed"]


def test_boxes_that_are_given_go_before(
    photos: Path, vlm_config: ProposeTargets, tmp_path: Path
) -> None:
    preset = replace(Preset(), propose=vlm_config)
    box = (Target("mug", "a.jpg", (1.0, 1.0, 9.0, 9.0)),)
    options = SceneOptions(photos, tmp_path, preset, targets=box, propose=True)
    given = read_scene(options)
    assert (given.targets, given.preset.propose.model) == (box, "")
    assert "targets were given, so none were proposed" in given.remarks
    entry = {"name": "mug", "image": "a.jpg", "box": [1, 1, 9, 9]}
    (photos / "targets.json").write_text(json.dumps({"targets": [entry]}))
    beside = read_scene(SceneOptions(photos, tmp_path, preset))
    assert (beside.targets, beside.preset.propose.model) == (box, "")
    asked = read_scene(SceneOptions(photos, tmp_path, preset, propose=True))
    assert (asked.targets, asked.preset.propose.model) == ((), vlm_config.model)
    assert any("targets.json lies beside the photos" in remark for remark in asked.remarks)
    (photos / "targets.json").write_text('{"targets": []}')
    none = read_scene(SceneOptions(photos, tmp_path, preset))
    assert (none.targets, none.preset.propose.model) == ((), "")


class TestCommand:
    """The options on the command line; nothing is computed."""

    @pytest.fixture
    def plan(self, photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
        def steps(*words: str, code: int = 0, command: str = "plan") -> Any:
            more = ["--engine", "local"] if command == "factorize" else []
            arguments = [command, str(photos), *words, *more, "--store", str(tmp_path / "store")]
            assert main([*arguments, "--out", str(tmp_path / "scenes"), "--json"]) == code
            return json.loads(capsys.readouterr().out)

        return steps

    def test_a_model_is_asked(self, plan: Any) -> None:
        steps = [entry["step"] for entry in plan("--propose", "gemini-3-flash-preview")["steps"]]
        assert steps.count("propose_targets") == steps.count("check_targets") == 1

    def test_a_box_goes_before(self, plan: Any) -> None:
        box = ("--box", "mug", "a.jpg", "1", "1", "9", "9")
        steps = [e["step"] for e in plan("--propose", "gemini-3-flash", *box)["steps"]]
        assert "propose_targets" not in steps

    @pytest.mark.parametrize(
        ("words", "said"),
        [
            (("--goal", "x"), "--goal is told to the model that proposes"),
            (("--propose", "gpt-9"), "how gpt-9 writes boxes is not known: set propose.boxes"),
            (("--propose", "gemini-3", "--set", "propose.tries=0"), "propose.tries must be"),
            (
                ("--set", "propose.model=gemini-3", "--set", "ground.model=grounding_dino"),
                "come either from gemini-3 or from grounding_dino",
            ),
        ],
    )
    def test_what_cannot_be_asked_is_wrong_use(
        self, plan: Any, words: tuple[str, ...], said: str
    ) -> None:
        assert said in plan(*words, code=2)["reasons"][0]

    def test_a_missing_key_or_weight_is_said_before_any_work(
        self, plan: Any, vlm: VlmServer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        found = plan("--propose", "gemini-3-flash", code=2, command="factorize")
        assert "needs a key: set the environment variable GEMINI_API_KEY" in found["reasons"][0]
        monkeypatch.setenv("GARDEN_WEIGHTS", str(tmp_path / "weights"))
        found = plan("--label", "mug", code=2, command="factorize")
        assert "grounding_dino needs its weights config.json" in found["reasons"][0]
        assert not (tmp_path / "scenes").exists()


def test_the_key_is_nowhere_in_what_a_scene_leaves(
    photos: Path, vlm: VlmServer, vlm_config: ProposeTargets, store: Store
) -> None:
    vlm.say(GOOD.replace("needed", KEY), Reply(status=401, body=f"not {KEY}".encode()))
    result, _did = run(request(photos, vlm_config), store)
    told = json.dumps([repr(e) for e in result.outcomes]) + str(scene_verdict(result))
    assert "refused the key" in told
    assert KEY not in told
    assert not any(KEY.encode() in p.read_bytes() for p in store.path.rglob("*") if p.is_file())
