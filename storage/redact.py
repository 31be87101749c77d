"""Take secrets out of texts that come from outside, before they are kept or shown.

What libraries and child processes say may hold credentials: the values of environment
variables whose names say so, user and password in an address, signatures in its query.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar
from urllib.parse import quote, unquote

HIDDEN = "***"
SHORTEST = 6  # characters; a shorter value would blot out common words
_LONG_LINE = 16  # of a secret with several lines, such as a private key

_SECRET_NAME = re.compile(
    r"SECRET|TOKEN(?!S|IZER)|PASSWORD|PASSWD|PASSPHRASE|CREDENTIAL|API_?KEY|ACCESS_?KEY|PRIVATE_?KEY"
    r"|(^|_)(KEY|PASS|PWD|PAT|AUTH)$",
    re.IGNORECASE,
)
_PATHS = re.compile(r"_(FILE|FILES|PATH|DIR|URI)$", re.IGNORECASE)
_USER_INFO = re.compile(r"(?<=://)[^\s/?#@\"'<>]+(?=@)")
_BEARER = re.compile(r"(?i)(authorization['\"]?\s*[:=]\s*['\"]?(?:\w+\s+)?)[^\s'\",]+")
_QUERY = re.compile(
    r"(?i)([?&](?:x-amz-(?:signature|credential|security-token)|sig|signature|token"
    r"|access_token|api_?key|key|password|secret)=)[^&\s\"'<>]+"
)

T = TypeVar("T")


def redact(text: str, environment: Mapping[str, str] | None = None) -> str:
    """Return ``text`` with ``***`` in the place of every secret.

    ``environment`` is the process' own if not given.
    """
    return _redact(text, secrets(os.environ if environment is None else environment))


def redacted(value: T) -> T:
    """Return a JSON-like value with all its texts redacted; keys of dicts stay."""
    known = secrets(os.environ)

    def walk(found: Any) -> Any:
        if isinstance(found, str):
            return _redact(found, known)
        if isinstance(found, dict):
            return {key: walk(item) for key, item in found.items()}
        if isinstance(found, list | tuple):
            return type(found)(walk(item) for item in found)
        return found

    clean: T = walk(value)
    return clean


@contextmanager
def without_secrets() -> Iterator[None]:
    """Let no error out whose text holds a secret: it becomes a RuntimeError that says the rest."""
    try:
        yield
    except Exception as error:
        said = redact(str(error))
        if said == str(error):
            raise
        raise RuntimeError(f"{type(error).__name__}: {said}") from None


def _redact(text: str, known: list[str]) -> str:
    for secret in known:
        text = text.replace(secret, HIDDEN)
    if "://" in text:
        text = _USER_INFO.sub(HIDDEN, text)
        text = _QUERY.sub(rf"\1{HIDDEN}", text)
    return _BEARER.sub(rf"\1{HIDDEN}", text)


def without_secret_variables(environment: Mapping[str, str]) -> dict[str, str]:
    """Return an environment less the variables that hold secrets, for programs that need none."""
    return {
        name: value
        for name, value in environment.items()
        if not _is_secret(name) and not secrets({name: value})
    }


def secrets(environment: Mapping[str, str]) -> list[str]:
    """Return the secrets in an environment in all forms they are written in, longest first."""
    found: set[str] = set()
    for name, value in environment.items():
        if _is_secret(name):
            found |= _forms(value.strip()) | (_forms(value) if value.strip() else set())
        if "://" in value:
            for user in _USER_INFO.findall(value):
                found |= _forms(user.partition(":")[2])
    return sorted(found, key=len, reverse=True)


def _is_secret(name: str) -> bool:
    return _SECRET_NAME.search(name) is not None and _PATHS.search(name) is None


def _forms(secret: str) -> set[str]:
    """Return a secret as it may appear: as it is, line by line, quoted in an address or repr."""
    lines = [line.strip() for line in secret.splitlines()]
    whole = {secret, *(line for line in lines if len(lines) > 1 and len(line) >= _LONG_LINE)}
    forms = whole | {quote(s, safe="") for s in whole} | {unquote(s) for s in whole}
    forms |= {repr(s)[1:-1] for s in whole}
    return {form for form in forms if len(form) >= SHORTEST}
