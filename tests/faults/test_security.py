"""Nothing leaves its folder, nothing unpickles, no secret is kept, nothing listens outwards."""

from __future__ import annotations

import ast
import json
import os
import pickle
import re
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from garden_models.scene import BadInput, Verdict
from garden_models.targets.boxes import check_name
from storage import Store
from storage.errors import StoreFormatError
from storage.manifest import Manifest, Member
from tasks.step import RunContext, StepEvent, StepFailed, run_context, step
from tests.tasks.step.test_nouns_stored import NOUNS, build
from tests.tasks.step.toy import Numbers, make

ROOT = Path(__file__).parents[2]
PACKAGES = ("flows", "tasks", "garden_models", "storage")
SOURCES = sorted(p for package in PACKAGES for p in (ROOT / package).rglob("*.py"))
SECRET = "wJalrXUtnFEMI/K7MDENG+bPxRfiCY"

# -- names ------------------------------------------------------------------------------

HOSTILE = st.lists(
    st.sampled_from(["..", ".", "", "a", "\\", "\0", "\n", "~", "C:", " ", "é", "-", "字" * 50]),
    min_size=1,
    max_size=4,
).map("/".join)


@given(name=HOSTILE | st.text(max_size=120))
@example("字" * 100)
def test_scene_and_target_names_stay_in_their_folder(name: str) -> None:
    try:
        accepted = check_name(name, "scene")
    except BadInput as error:
        assert "cannot be the name of a scene" in str(error)
        return
    assert accepted == name
    assert (Path("/out") / name).parent == Path("/out")
    assert name not in ("", ".", "..") and not {"/", "\\", "\0", "\n"} & set(name)
    assert len(name.encode()) <= 200  # with what staging adds, a file system takes it


@given(path=HOSTILE | st.text(max_size=40))
def test_members_of_a_manifest_stay_in_their_object(path: str) -> None:
    data = Manifest("X", "X/1", "b3:0", {path: Member(1, "b3:1")}).to_bytes()
    try:
        accepted = Manifest.from_bytes(data)
    except StoreFormatError:
        return
    assert list(accepted.members) == [path]
    place = Path("/objects/ab/cd") / path
    assert place.is_relative_to("/objects/ab/cd") and ".." not in place.parts


# -- pickles ----------------------------------------------------------------------------

UNPICKLERS = {"pickle", "cPickle", "_pickle", "cloudpickle", "dill", "shelve", "marshal", "joblib"}


def calls_and_imports(source: str) -> list[str]:
    """Return what in a module could run code from data, as ``line: what``."""
    found = []
    for node in ast.walk(ast.parse(source)):
        line = getattr(node, "lineno", 0)
        if isinstance(node, ast.Import):
            names = {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names = {(node.module or "").partition(".")[0], *(a.name for a in node.names)}
        else:
            names = set()
        found += [f"{line}: import {name}" for name in sorted(names & UNPICKLERS)]
        if not isinstance(node, ast.Call):
            continue
        call = ast.unparse(node.func)
        given = {k.arg: ast.unparse(k.value) for k in node.keywords}
        if given.get("allow_pickle", "False") != "False":
            found.append(f"{line}: {call}(allow_pickle)")
        if call == "torch.load" and given.get("weights_only") != "True":
            found.append(f"{line}: torch.load without weights_only=True")
        if call in ("eval", "exec", "yaml.load", "yaml.unsafe_load", "__import__"):
            found.append(f"{line}: {call}")
        if call.split(".")[-1] in ("read_pickle", "to_pickle") or call == "os.system":
            found.append(f"{line}: {call}")
        if given.get("shell", "False") != "False":
            found.append(f"{line}: {call}(shell)")
    return found


@pytest.mark.parametrize(
    "code",
    [
        "import pickle",
        "from joblib import load",
        "import numpy as np; np.load('a.npy', allow_pickle=True)",
        "import torch; torch.load('w.pt')",
        "import torch; torch.load('w.pt', weights_only=False)",
        "import yaml; yaml.load(text)",
        "import subprocess; subprocess.run('ls', shell=True)",
    ],
)
def test_the_search_for_pickles_finds_them(code: str) -> None:
    assert calls_and_imports(code)


PEERS = "flows/benchmark/orchestration/peers/"
"""Other systems are measured as they are; what they unpickle they have just written."""


def test_nothing_of_ours_unpickles() -> None:
    assert len(SOURCES) > 200
    found = {str(p.relative_to(ROOT)): calls_and_imports(p.read_text("utf-8")) for p in SOURCES}
    ours = {path: lines for path, lines in found.items() if lines and not path.startswith(PEERS)}
    assert ours == {}


def test_reading_any_artifact_unpickles_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store.open(tmp_path / "store", durability="none")
    published = [(noun, store.publish(build(noun, 2)).object) for noun in NOUNS]

    def refuse(*_arguments: object, **_named: object) -> None:
        raise AssertionError("something was unpickled")

    for name in ("loads", "load", "Unpickler"):
        monkeypatch.setattr(pickle, name, refuse)
    for noun, digest in published:
        store.read(digest, noun)


# -- secrets ----------------------------------------------------------------------------


@dataclass(frozen=True)
class Talk:
    how: str
    address: str = "plain"


def say_secret() -> str:
    return os.environ["GARDEN_TEST_TOKEN"]


@step(version=1, retries=0)
def talk(numbers: Numbers, config: Talk) -> Numbers:
    said = f"the server at {config.address} refused {say_secret()}"
    if config.how == "raise":
        raise BadInput(said)
    if config.how == "bug":
        raise KeyError(said)
    return Numbers(numbers.values, Verdict("degraded", (said,)))


@step(version=1, isolated=True, retries=0)
def talk_apart(numbers: Numbers, config: Talk) -> Numbers:
    print(f"library: key is {say_secret()}", flush=True)
    if config.how == "die":
        os.abort()
    if config.how == "die late":  # the tail that is kept begins inside of the secret
        print("x" * 1985, flush=True)
        os._exit(1)
    return talk.fn(numbers, config)  # type: ignore[no-any-return]


def everything_kept(store: Store) -> str:
    """Return the text of every file in a store."""
    files = (p for p in store.path.rglob("*") if p.is_file())
    return "\0".join(p.read_bytes().decode("latin-1") for p in files)


@pytest.mark.parametrize("how", ["raise", "bug", "reasons", "die", "die late"])
@pytest.mark.parametrize("apart", [False, True], ids=["here", "in a child"])
def test_no_secret_reaches_a_record_an_event_or_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, apart: bool
) -> None:
    if "die" in how and not apart:
        return
    monkeypatch.setenv("GARDEN_TEST_TOKEN", SECRET)
    store = Store.open(tmp_path / "store", durability="none")
    events: list[StepEvent] = []
    config = Talk(how, "s3://key:pa55word@bucket")
    error: BaseException | None = None
    with run_context(RunContext(store, "room", events=events.append)) as context:
        try:
            ref: Any = (talk_apart if apart else talk)(make(3), config)
            assert "***" in ref.reasons[0]
        except StepFailed as failure:
            error = failure
            assert "***" in failure.reason or how == "die late"
    assert (error is None) == (how == "reasons")
    told = repr((events, context.outcomes, list(store.actions())))
    told += "".join(traceback.format_exception(error)) if error else ""
    for secret in (SECRET, SECRET[-12:], "pa55word"):
        assert secret not in told
        assert secret not in everything_kept(store)


def test_a_secret_among_the_settings_counts_in_the_key_and_is_not_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GARDEN_TEST_TOKEN", SECRET)
    store = Store.open(tmp_path / "store", durability="none")
    with run_context(RunContext(store, "room")):
        one = talk(make(3), Talk("reasons", SECRET))
        two = talk(make(3), Talk("reasons", SECRET[::-1]))
    assert one.key != two.key
    assert SECRET not in repr([record.parts for record in store.actions()])
    assert "pa55word" not in two.why.sentence


def test_no_secret_reaches_the_report_or_the_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from PIL import Image

    from flows.command import main

    monkeypatch.setenv("GARDEN_TEST_TOKEN", SECRET)
    photos = tmp_path / "room"
    photos.mkdir()
    for i in range(3):
        Image.fromarray(np.full((60, 80, 3), 40 * i, np.uint8)).save(photos / f"{i}.jpg")

    def refuse(*_arguments: object) -> None:
        raise OSError(f"https://me:{SECRET}@host said no to {SECRET}")

    monkeypatch.setattr("storage.formats.photos.read_photo", refuse)
    code = main(
        ["factorize", str(photos), "--engine", "local", "--json",
         "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")]
    )  # fmt: skip
    told = capsys.readouterr()
    assert code == 1
    assert "***" in json.loads(told.out)["reasons"][0]
    written = {p.name: p.read_bytes().decode("latin-1") for p in (tmp_path / "out/room").iterdir()}
    assert "***" in written["report.json"] and "***" in written["report.html"]
    for text in (told.out, told.err, *written.values()):
        assert SECRET not in text


# -- sockets ----------------------------------------------------------------------------

ANYWHERE = re.compile(r"(?<![\d.])0\.0\.0\.0(?![\d.])|\[::\]|INADDR_ANY|[\"']::[\"']")
BINDING = ("host", "address", "bind", "scheduler_host", "dashboard_address", "listen")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_nothing_of_ours_listens_to_other_machines(path: Path) -> None:
    text = path.read_text("utf-8")
    assert not ANYWHERE.search(text), "bind to 127.0.0.1 unless the user says otherwise"
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.keyword) and node.arg in BINDING:
            assert ast.unparse(node.value) not in ("''", "'*'"), f"line {node.value.lineno}"


def documents(folder: Path) -> Iterator[tuple[Path, Any]]:
    for path in sorted(folder.rglob("*.y*ml")):
        for document in yaml.safe_load_all(path.read_text("utf-8")):
            yield path, document


def test_deployed_servers_are_published_on_loopback_by_default() -> None:
    """Inside a container a server must listen to all; its port is published on 127.0.0.1.

    In a cluster it is seen by the cluster only, until somebody forwards or publishes it.
    """
    published = []
    for path, document in documents(ROOT / "deploy"):
        for name, service in (document.get("services") or {}).items():
            published += [str(port) for port in service.get("ports", [])]
            assert service.get("network_mode") != "host", f"{path.name}: {name}"
        if document.get("kind") == "Service":
            assert document["spec"].get("type", "ClusterIP") == "ClusterIP", path.name
        assert document.get("kind") != "Ingress", path.name
        assert "hostNetwork: true" not in path.read_text() and "hostPort" not in path.read_text()
    assert published, "compose publishes the server's page"
    for port in published:
        assert re.match(r"127\.0\.0\.1:|\$\{\w+:-127\.0\.0\.1\}:", port), port


@pytest.mark.slow
def test_the_server_that_a_run_starts_listens_on_loopback_only(prefect_server: str) -> None:
    assert re.match(r"http://(127\.0\.0\.1|localhost):\d+", prefect_server)
    port = int(re.findall(r":(\d+)", prefect_server)[0])
    listening = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            address, state = line.split()[1], line.split()[3]
            if state == "0A" and int(address.partition(":")[2], 16) == port:
                listening.append(address.partition(":")[0])
    assert listening == ["0100007F"]  # 127.0.0.1
