"""No secret stays in a text, in whichever form it is written; all else does."""

from __future__ import annotations

from urllib.parse import quote

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from storage.redact import (
    HIDDEN,
    redact,
    redacted,
    secrets,
    without_secret_variables,
    without_secrets,
)

SECRET = "wJalrXUtnFEMI/K7MDENG+bPxRfiCY"
NAMES = [
    "AWS_SECRET_ACCESS_KEY",
    "OPENAI_API_KEY",
    "HF_TOKEN",
    "PREFECT_API_KEY",
    "MYSQL_PWD",
    "PGPASSWORD",
    "my_private_key",
]


@pytest.mark.parametrize("name", NAMES)
def test_values_of_secret_variables_are_hidden(name: str) -> None:
    said = redact(f"403 for key {SECRET}: see a.jpg", {name: SECRET})
    assert said == f"403 for key {HIDDEN}: see a.jpg"


@example(secret="00000\xa0", before="", after="", write=str)
@given(
    secret=st.text(
        st.characters(min_codepoint=33, max_codepoint=0x2FF), min_size=6, max_size=40
    ).filter(str.strip),
    before=st.text(max_size=20),
    after=st.text(max_size=20),
    write=st.sampled_from([str, lambda s: quote(s, safe=""), lambda s: repr(s)[1:-1]]),
)
def test_no_form_of_a_secret_is_left(secret: str, before: str, after: str, write: object) -> None:
    form = write(secret)  # type: ignore[operator]
    assert form not in redact(before + form + after, {"X_TOKEN": secret}).replace(HIDDEN, "\0")


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("postgresql://garden:pa55word@db:5432/x", "postgresql://***@db:5432/x"),
        ("get s3://AKIA:secret@bucket/a.jpg now", "get s3://***@bucket/a.jpg now"),
        ("https://h/a?X-Amz-Signature=abc123&n=1", "https://h/a?X-Amz-Signature=***&n=1"),
        ("Authorization: Bearer abc.def-123", "Authorization: Bearer ***"),
        ("see https://docs.example/page?n=1#top", "see https://docs.example/page?n=1#top"),
        ("mail a@b.c about photo IMG_1.jpg", "mail a@b.c about photo IMG_1.jpg"),
    ],
)
def test_credentials_in_addresses_are_hidden(text: str, left: str) -> None:
    assert redact(text, {}) == left


def test_the_password_of_an_address_is_a_secret_by_itself() -> None:
    url = {"PREFECT_API_DATABASE_CONNECTION_URL": "postgresql://garden:pa55word@db/x"}
    assert redact('authentication with "pa55word" failed for garden', url) == (
        'authentication with "***" failed for garden'
    )


def test_words_that_only_look_like_it_stay() -> None:
    plain = {
        "TOKENIZERS_PARALLELISM": "disabled",
        "MAX_TOKENS": "100000",
        "HOME": "/home/kitchen",
        "SSH_AUTH_SOCK": "/run/agent.sock",
        "AWS_SHARED_CREDENTIALS_FILE": "/home/kitchen/.aws",
        "EMPTY_TOKEN": "",
        "SHORT_TOKEN": "abc",
    }
    assert secrets(plain) == []


def test_a_key_of_several_lines_is_hidden_line_by_line() -> None:
    key = "-----BEGIN KEY-----\nMIIEvQIBADANBgkqhkiG9w0B\nAQEFAASCBKcwggSjAgEAAoIB\n-----END-----"
    said = redact("it printed last: AQEFAASCBKcwggSjAgEAAoIB", {"SIGNING_KEY": key})
    assert said == f"it printed last: {HIDDEN}"


def test_documents_are_redacted_throughout(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("X_API_KEY", SECRET)
    document = {"reasons": [f"a {SECRET}"], "n": 1, "deep": {"t": (SECRET, None, 2.5)}}
    assert redacted(document) == {
        "reasons": [f"a {HIDDEN}"],
        "n": 1,
        "deep": {"t": (HIDDEN, None, 2.5)},
    }


def test_an_error_with_a_secret_does_not_get_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("X_API_KEY", SECRET)
    with pytest.raises(RuntimeError) as caught, without_secrets():
        raise ValueError(f"bad key {SECRET}")
    assert str(caught.value) == f"ValueError: bad key {HIDDEN}"
    assert caught.value.__suppress_context__
    with pytest.raises(ValueError, match="plain"), without_secrets():
        raise ValueError("plain")


def test_programs_that_need_no_secret_are_given_none() -> None:
    environment = {
        "PATH": "/bin",
        "HOME": "/home/me",
        "TOKENIZERS_PARALLELISM": "false",
        "AWS_SHARED_CREDENTIALS_FILE": "/home/me/.aws/credentials",
        "GEMINI_API_KEY": "AIza-123456789",
        "HF_TOKEN": "hf_abcdefgh",
        "PIN_PASSWORD": "1234",
        "DATABASE_URL": "postgresql://me:hunter2-hunter2@host/garden",
        "no_proxy": "localhost",
    }
    kept = without_secret_variables(environment)
    assert kept.keys() == {
        "PATH", "HOME", "TOKENIZERS_PARALLELISM", "AWS_SHARED_CREDENTIALS_FILE", "no_proxy",
    }  # fmt: skip
