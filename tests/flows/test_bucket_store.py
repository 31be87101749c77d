"""Every command takes a store in a bucket, and says what is wrong with one."""

from __future__ import annotations

import json
import socket
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from flows.command import main
from flows.command.store_option import store_address
from storage import Store
from tests.s3_server import BUCKET, ENVIRONMENT, S3Server
from tests.storage.test_store import record_of

PLACE = f"s3://{BUCKET}/commands"


def output(capsys: pytest.CaptureFixture[str], *argv: str) -> tuple[int, str, str]:
    code = main(list(argv))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_store_is_an_address(monkeypatch: pytest.MonkeyPatch) -> None:
    assert store_address(PLACE) == PLACE
    monkeypatch.setenv("GARDEN_STORE", PLACE)
    assert store_address(None) == PLACE
    monkeypatch.delenv("GARDEN_STORE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/cache")
    assert store_address(None) == "/cache/garden/store"


def test_what_a_bucket_holds_is_listed_verified_and_explained(
    s3: S3Server, capsys: pytest.CaptureFixture[str]
) -> None:
    store = Store.open(PLACE)
    record = record_of(store)
    parts = {"inputs": {}, "config": {}, "packages": {}, "code": {}}
    store.record(type(record)(**(vars(record) | {"parts": parts})))
    code, out, _err = output(capsys, "store", "ls", "--store", PLACE, "--json")
    assert code == 0
    listed = json.loads(out)
    assert listed["store"] == PLACE
    assert [action["step"] for action in listed["actions"]] == ["segment"]
    assert output(capsys, "store", "verify", "--store", PLACE)[0] == 0
    assert output(capsys, "why", "segment", "--store", PLACE)[0] == 0
    code, out, _err = output(capsys, "doctor", "--store", PLACE)
    assert PLACE in out
    assert not any(secret in out for secret in ENVIRONMENT.values() if "/" in secret)


def test_a_plan_is_made_from_a_bucket(
    s3: S3Server, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.png", "b.png"):
        Image.fromarray(np.zeros((60, 80, 3), np.uint8)).save(tmp_path / name)
    code, out, _err = output(capsys, "plan", str(tmp_path), "--store", PLACE)
    assert code == 0
    assert "would run" in out


@pytest.mark.parametrize(
    ("place", "said"),
    [
        (f"s3://{BUCKET}/nothing", "no store at"),
        ("s3://elsewhere/x", "no bucket"),
        ("gs://elsewhere/x", "not known"),
        ("s3://Capital/x", "s3://BUCKET/PREFIX"),
    ],
)
def test_a_wrong_address_is_wrong_use(
    s3: S3Server, capsys: pytest.CaptureFixture[str], place: str, said: str
) -> None:
    code, _out, err = output(capsys, "store", "ls", "--store", place)
    assert code == 2
    assert said in err


def test_a_server_that_is_not_there_fails_the_command(
    s3: S3Server, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket() as taken:  # bound, but nobody listens
        taken.bind(("127.0.0.1", 0))
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{taken.getsockname()[1]}")
        code, _out, err = output(capsys, "store", "ls", "--store", PLACE)
    assert code == 1
    assert "cannot be reached" in err
    assert "Traceback" not in err
