"""Find a model's server and the key to it; keep both out of everything that is kept."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from urllib.parse import SplitResult, unquote, urlsplit, urlunsplit

from garden_models.scene import BadInput
from garden_models.targets.config import ProposeTargets, api_of
from storage.redact import redact

GEMINI = "https://generativelanguage.googleapis.com"
OPENAI = "https://api.openai.com/v1"
GEMINI_KEYS = ("GEMINI_API_KEY", "GOOGLE_API_KEY")
OPENAI_KEY = "OPENAI_API_KEY"


@dataclass(frozen=True)
class Server:
    """Where to ask, and with what; ``shown`` is its name in sentences, without secrets."""

    base: str
    shown: str
    key_variable: str
    key: str = field(default="", repr=False)
    login: tuple[str, str] | None = field(default=None, repr=False)

    def clean(self, text: str) -> str:
        """Return a text of the server's without the key, should it have repeated it."""
        secrets = {"KEY": self.key, "PASSWORD": self.login[1] if self.login else ""}
        return redact(redact(text, secrets))


def server_of(config: ProposeTargets) -> Server:
    """Return the server of the configured model.

    The usual variables' keys go to the API's own address only; to another one goes the key
    of ``config.key_variable``. Raises BadInput if a key is needed and there is none.
    """
    own = GEMINI if api_of(config) == "gemini" else OPENAI
    parts = _address(config.address or own)
    variable, key = _key(config, own)
    host = parts.hostname or ""
    shown = f"{host}:{parts.port}" if parts.port else host
    netloc = f"[{host}]" if ":" in host else host
    netloc += f":{parts.port}" if parts.port else ""
    base = urlunsplit((parts.scheme, netloc, parts.path.rstrip("/"), "", ""))
    login = (unquote(parts.username), unquote(parts.password or "")) if parts.username else None
    return Server(base, shown, variable, key, login)


def _address(text: str) -> SplitResult:
    try:
        parts = urlsplit(text)
        fits = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        fits = False
    if not fits or parts.query or parts.fragment:
        raise BadInput(
            f"propose.address {redact(text)!r} is no address of a server: write it as "
            "http://HOST:PORT/v1"
        )
    return parts


def _key(config: ProposeTargets, own: str) -> tuple[str, str]:
    """Return the variable that holds the key, and the key (empty: none is needed)."""
    if config.key_variable:
        key = os.environ.get(config.key_variable, "").strip()
        if not key:
            raise BadInput(
                f"the environment variable {config.key_variable} is not set: it should hold the "
                f"key to the server of {config.model}"
            )
        return config.key_variable, key
    if config.address:
        return "", ""
    usual = GEMINI_KEYS if own == GEMINI else (OPENAI_KEY,)
    for name in usual:
        if key := os.environ.get(name, "").strip():
            return name, key
    raise BadInput(
        f"asking {config.model} needs a key: set the environment variable {' or '.join(usual)}, "
        "or propose.address for a server of your own"
    )
