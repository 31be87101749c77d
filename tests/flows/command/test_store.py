"""``garden store`` and ``garden why``: what they print, their JSON, and their exit codes."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from flows.command import main
from storage import Store
from tests.storage.history import age, did, key_of, keys, value
from tests.storage.test_repair import flip
from tests.storage.test_store import record_of
from tests.tasks.step.toy import chain, in_run


class Shell:
    """Run commands on one store."""

    def __init__(self, store: Store, capsys: pytest.CaptureFixture[str]) -> None:
        self.store, self._capsys = store, capsys

    def __call__(self, *words: str, code: int = 0) -> str:
        assert main([*words, "--store", str(self.store.path)]) == code
        return "".join(self._capsys.readouterr())

    def json(self, *words: str, code: int = 0) -> Any:
        assert main([*words, "--json", "--store", str(self.store.path)]) == code
        return json.loads(self._capsys.readouterr().out)


@pytest.fixture
def shell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(Store.open(tmp_path / "store", durability="none"), capsys)


def test_ls_lists_the_newest_last_and_filters(shell: Shell) -> None:
    for days, scene in ((3, "kitchen"), (2, "hall"), (1, "kitchen")):
        did(shell.store, f"{scene}{days}", days, days_ago=days, scene=scene, label="mug")
    listed = shell.json("store", "ls")
    assert [row["key"] for row in listed["actions"]] == [
        key_of("kitchen3"),
        key_of("hall2"),
        key_of("kitchen1"),
    ]
    assert listed["bytes"] == shell.store.size()
    row = listed["actions"][0]
    assert (row["step"], row["target"], row["status"]) == ("segment", "mug", "ok")
    assert row["content"]["value"].startswith("b3:")
    assert len(shell.json("store", "ls", "--scene", "kitchen")["actions"]) == 2
    assert len(shell.json("store", "ls", "--last", "1")["actions"]) == 1
    text = shell("store", "ls", "--step", "segment")
    assert text.count("segment[mug]") == 3
    assert "3 actions shown" in text


def test_options_may_stand_before_the_action(shell: Shell) -> None:
    assert main(["store", "--store", str(shell.store.path), "ls"]) == 0


def test_verify_says_what_to_do_and_repair_does_it(shell: Shell) -> None:
    shell("store", "verify")
    flip(shell.store, did(shell.store, "a", 1))
    assert "garden store repair" in shell("store", "verify", code=1)
    problems = shell.json("store", "verify", code=1)["problems"]
    assert [problem["kind"] for problem in problems] == ["object", "dangling"]
    assert "quarantine" in shell("store", "repair")
    shell("store", "verify")
    assert shell.json("store", "repair")["repaired"] == []


def test_gc_tells_does_and_says_when_it_cannot(shell: Shell) -> None:
    for days in (2, 3, 4):
        did(shell.store, f"k{days}", days, days_ago=days)
    did(shell.store, "young", 9)
    told = shell.json("store", "gc", "--unused", "60h", "--last", "0", "--dry-run")
    assert {one["key"] for one in told["forgotten"]} == {key_of("k3"), key_of("k4")}
    assert len(keys(shell.store)) == 4
    done = shell("store", "gc", "--unused", "60h", "--last", "0")
    assert "2 results forgotten" in done
    assert keys(shell.store) == {key_of("k2"), key_of("young")}
    assert "shorter --grace" in shell("store", "gc", "--quota", "1 B", code=1)
    assert keys(shell.store) == {key_of("young")}


@pytest.mark.parametrize("words", [["--quota", "5zB"], ["--quota", "-1"], ["--grace", "soon"]])
def test_sizes_and_times_are_checked(shell: Shell, words: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        shell("store", "gc", *words)
    assert caught.value.code == 2


def test_the_quota_of_the_environment_is_the_default(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    did(shell.store, "old", 1, days_ago=9)
    monkeypatch.setenv("GARDEN_STORE_QUOTA", "1kB")
    assert shell.json("store", "gc")["quota_bytes"] == 1000
    assert keys(shell.store) == set()


def test_pins_hold_until_they_are_unpinned(shell: Shell) -> None:
    record = did(shell.store, "a", 1, days_ago=9)
    assert "figure 2" in shell("store", "pin", "one", "kitchen/segment", "--reason", "figure 2")
    assert shell.json("store", "pin", "all", "--scene", "kitchen")["scenes"] == ["kitchen"]
    shell("store", "gc", "--quota", "1B", code=1)
    assert keys(shell.store) == {record.key}
    assert [pin["name"] for pin in shell.json("store", "pins")["pins"]] == ["all", "one"]
    for name in ("one", "all"):
        shell("store", "unpin", name)
    shell("store", "gc", "--quota", "1B")
    assert keys(shell.store) == set()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pin", "a"], "--scene"),
        (["pin", "a", "nothing"], "garden store ls"),
        (["pin", "a", "--scene", "nowhere"], "nowhere"),
        (["pin", "../a", "segment"], "letters"),
        (["unpin", "a"], "garden store pins"),
    ],
)
def test_wrong_use_is_explained(shell: Shell, words: list[str], said: str) -> None:
    did(shell.store, "a", 1)
    assert said in shell("store", *words, code=2)


def test_conflicts_name_the_steps_that_are_not_steady(shell: Shell) -> None:
    first = did(shell.store, "a", 1, host="one")
    again = record_of(shell.store, value(2), key=first.key, host="two")
    shell.store.record(again)
    [row] = shell.json("store", "conflicts")["conflicts"]
    assert (row["key"], row["host"], row["counts_host"]) == (first.key, "two", "one")
    assert row["content"] != row["counts"]
    assert "not deterministic" in shell("store", "conflicts")


def test_compact_counts_the_rows(shell: Shell) -> None:
    did(shell.store, "a", 1)
    assert shell.json("store", "compact")["rows"] == 1


def test_light_actions_load_no_numbers_library(tmp_path: Path) -> None:
    Store.open(tmp_path / "store")
    code = (
        "import sys; from flows.command import main\n"
        "for action in ('ls', 'pins', 'conflicts', 'gc'):\n"
        "    assert main(['store', action, '--store', sys.argv[1]]) == 0\n"
        "heavy = {'numpy', 'zarr', 'pyarrow', 'torch', 'prefect', 'jaxtyping'}\n"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "store")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def names(chain: list[dict[str, Any]]) -> list[tuple[str, int, bool]]:
    return [(entry["step"], entry["depth"], entry["collected"]) for entry in chain]


def test_why_walks_through_every_step_and_input(shell: Shell) -> None:
    in_run(shell.store, chain)
    found = shell.json("why", "pick[bulldozer]")["chain"]
    assert names(found) == [("pick", 0, False), ("scale", 1, False), ("make", 2, False)]
    assert found[2]["config"] == {"count": 4}
    assert all(entry["unknown_inputs"] == {} for entry in found)


def test_why_walks_on_through_what_was_collected(shell: Shell) -> None:
    in_run(shell.store, chain)
    for record in shell.store.actions():
        age(shell.store, record, 9 if record.step == "scale" else 0)
    shell.store.collect(quota_bytes=0)
    assert {record.step for record in shell.store.actions()} == {"make", "pick"}
    found = shell.json("why", "pick")["chain"]
    assert names(found) == [("pick", 0, False), ("scale", 1, True), ("make", 2, False)]
    assert "collected, and made again" in shell("why", "pick")


def test_why_names_an_input_that_nothing_is_known_of(shell: Shell) -> None:
    content = "b3:" + "0" * 64
    record = did(shell.store, "a", 1)
    parts = {"inputs": {"numbers": content}, "config": {}, "packages": {}}
    shell.store.record(dataclasses.replace(record, key=key_of("b"), step="last", parts=parts))
    [entry] = shell.json("why", "last")["chain"]
    assert entry["unknown_inputs"] == {"numbers": content}
    assert "numbers b3:000000000000" in shell("why", "last")
