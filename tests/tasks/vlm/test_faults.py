"""A server that gives no answer ends in one clear sentence; only what may pass is asked again."""

from __future__ import annotations

import json
import logging
import socket
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from garden_models.progress import silent
from garden_models.scene import BadInput
from garden_models.targets.config import ProposeTargets
from garden_models.targets.vlm_model import VlmAnswer, VlmRequest
from tasks.step import Cancelled
from tasks.vlm import ModelUnavailable, asker
from tests.vlm_server import KEY, LOCAL_MODEL, MODEL, Reply, VlmServer

QUESTION = VlmRequest("What is there?", (), {"type": "object", "properties": {}})
GOOGLES_429 = {
    "error": {
        "code": 429, "status": "RESOURCE_EXHAUSTED", "message": "Quota exceeded.",
        "details": [{"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "0.3s"}],
    }
}  # fmt: skip
INVALID_KEY = {
    "error": {
        "code": 400, "status": "INVALID_ARGUMENT", "message": f"API key not valid: {KEY}",
        "details": [{"reason": "API_KEY_INVALID"}],
    }
}  # fmt: skip


def failed(status: int, document: object = None, **headers: str) -> Reply:
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    return Reply(status=status, body=json.dumps(document).encode(), headers=named)


def ask(config: ProposeTargets, progress: Callable[[float, str], None] = silent) -> VlmAnswer:
    return asker(config, progress)(QUESTION)


def sentence(config: ProposeTargets) -> str:
    with pytest.raises(ModelUnavailable) as caught:
        ask(config)
    said = str(caught.value)
    assert "\n" not in said
    assert KEY not in said
    return said


@pytest.mark.parametrize(
    ("reply", "words"),
    [
        (failed(401, {"error": {"message": f"Incorrect API key provided: {KEY}"}}),
         "refused the key in GARDEN_TEST_DOOR (401: Incorrect API key provided: ***)"),
        (failed(403, {"error": {"message": "no access"}}), "refused the key"),
        (failed(400, INVALID_KEY), "refused the key in GARDEN_TEST_DOOR (400: API key"),
        (failed(404, [{"error": {"message": "is not found"}}]), f"knows no model {MODEL} (404: is"),
        (failed(400, {"error": {"message": "response_format?"}}), "propose.structured = false"),
        (failed(413, "too large"), "(413: "),
        (failed(429, {"error": {"code": "insufficient_quota", "message": "Pay."}}),
         "takes no more requests for now (429: Pay.): start the run again later"),
        (failed(429, {}, Retry_After="3600"), "start the run again later"),
        (failed(302, {}, Location="http://127.0.0.1:9/"), "sends on to another address"),
        (failed(501, {}), "refused the question"),
        (Reply(body=b"<html>Welcome</html>"), "not its API's: '<html"),
        (Reply(body=b'{"choices": 7}'), "not its API's"),
        (Reply(body=b"x" * 9_000_000), "more than an answer can be long"),
        (Reply(""), f"{MODEL} gave an empty answer (STOP)"),
        (Reply("", finish="SAFETY"), "empty answer (SAFETY)"),
        (Reply(body=b'{"promptFeedback": {"blockReason": "PROHIBITED"}}'), "(PROHIBITED)"),
    ],
)  # fmt: skip
def test_what_stays_is_not_asked_again(
    reply: Reply, words: str, vlm: VlmServer, config: ProposeTargets
) -> None:
    vlm.say(reply, "never given")
    assert words in sentence(config)
    assert len(vlm.asked) == 1


@pytest.mark.parametrize(
    "reply",
    [failed(429, {}), failed(500, {}), failed(503, {}), failed(408, {}), Reply(hang_up=True)],
)
def test_what_may_pass_is_asked_again(reply: Reply, vlm: VlmServer, config: ProposeTargets) -> None:
    vlm.say(reply, reply, "there it is")
    answer = ask(config)
    assert (answer.text, answer.model) == ("there it is", MODEL)
    assert (answer.input_tokens, answer.output_tokens) == (1200, 100)
    assert len(vlm.asked) == 3


def test_asking_again_has_an_end(vlm: VlmServer, config: ProposeTargets) -> None:
    vlm.say(*[failed(503, {"error": {"message": "overloaded"}})] * 9)
    assert "failed (503: overloaded)" in sentence(config)
    assert len(vlm.asked) == config.tries
    assert "takes no more requests" in sentence_after(vlm, config, failed(429, {}))


def sentence_after(vlm: VlmServer, config: ProposeTargets, reply: Reply) -> str:
    vlm._replies = [reply] * 9
    return sentence(config)


@pytest.mark.parametrize("reply", [failed(429, {}, Retry_After="0.3"), failed(429, GOOGLES_429)])
def test_it_waits_as_long_as_the_server_asks(
    reply: Reply, vlm: VlmServer, config: ProposeTargets
) -> None:
    vlm.say(reply, "now")
    started = time.monotonic()
    assert ask(config).text == "now"
    assert time.monotonic() - started >= 0.3


def test_a_server_that_is_silent_is_given_up(vlm: VlmServer, config: ProposeTargets) -> None:
    impatient = replace(config, timeout_s=0.2, tries=2)
    vlm.say(Reply("late", delay_s=2), Reply("late", delay_s=2))
    assert "did not answer within 0.2 s" in sentence(impatient)
    assert len(vlm.asked) == 2


def test_a_server_that_is_not_there(config: ProposeTargets, vlm: VlmServer) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        nowhere = f"http://127.0.0.1:{probe.getsockname()[1]}"
    said = sentence(replace(config, address=nowhere, tries=2))
    assert f"{nowhere.removeprefix('http://')} cannot be reached" in said


def test_the_users_stop_ends_the_waiting(vlm: VlmServer, config: ProposeTargets) -> None:
    def stop(_share: float, doing: str) -> None:
        if "busy" in doing:
            raise Cancelled("the run was stopped")

    vlm.say(failed(429, {}, Retry_After="100"))
    with pytest.raises(Cancelled):
        ask(config, stop)
    assert len(vlm.asked) == 1


def test_the_users_stop_does_not_wait_for_a_silent_server(
    vlm: VlmServer, config: ProposeTargets
) -> None:
    def stop(_share: float, _doing: str) -> None:
        raise Cancelled("the run was stopped")

    vlm.say(Reply("late", delay_s=9))
    with pytest.raises(Cancelled):
        ask(replace(config, timeout_s=5.0), stop)


def test_the_key_is_in_its_header_and_nowhere_else(
    vlm: VlmServer, config: ProposeTargets, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    vlm.say(f"Your key is {KEY}!", "{}")
    assert ask(config).text == "Your key is ***!"
    asked = vlm.asked[0]
    assert asked.headers["x-goog-api-key"] == KEY
    assert asked.path == f"/v1beta/models/{MODEL}:generateContent"
    ask(replace(config, model=LOCAL_MODEL, address=f"{vlm.url}/v1/"))
    assert vlm.asked[1].headers["authorization"] == f"Bearer {KEY}"
    assert vlm.asked[1].path == "/v1/chat/completions"
    assert all(KEY not in json.dumps(asked.document) + asked.path for asked in vlm.asked)
    assert KEY not in caplog.text


def test_a_login_in_the_address_reaches_the_server_alone(
    vlm: VlmServer, config: ProposeTargets, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    address = vlm.url.replace("http://", "http://anna:p%40ssword7@")
    wanted = replace(config, address=address, key_variable="")
    vlm.say("yes", failed(401, {"error": {"message": "p@ssword7 is wrong"}}))
    ask(wanted)
    assert vlm.asked[0].headers["authorization"].startswith("Basic ")
    with pytest.raises(ModelUnavailable) as caught:
        ask(wanted)
    for secret in ("p@ssword7", "p%40ssword7"):
        assert secret not in str(caught.value) + caplog.text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"key_variable": "", "address": ""}, "GEMINI_API_KEY or GOOGLE_API_KEY"),
        ({"key_variable": "", "address": "", "model": "gpt-9"}, "OPENAI_API_KEY"),
        ({"key_variable": "NO_SUCH_KEY"}, "NO_SUCH_KEY is not set"),
        ({"address": "localhost:8000"}, "no address of a server"),
        ({"address": "http://host:99999/v1"}, "no address of a server"),
        ({"address": "http://host/v1?api_key=abcdef12"}, "no address of a server"),
    ],
)
def test_without_key_or_address_nothing_is_asked(
    changes: dict[str, str],
    words: str,
    config: ProposeTargets,
    vlm: VlmServer,
) -> None:
    with pytest.raises(BadInput, match=words) as caught:
        asker(replace(config, **changes), silent)  # type: ignore[arg-type]
    assert "abcdef12" not in str(caught.value)
    assert vlm.asked == []


def test_the_usual_key_goes_to_no_other_address(
    vlm: VlmServer, config: ProposeTargets, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GEMINI_API_KEY", KEY)
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    vlm.say("yes", "yes")
    ask(replace(config, key_variable=""))
    ask(replace(config, key_variable="", model=LOCAL_MODEL))
    assert all(KEY not in str(asked.headers) for asked in vlm.asked)
