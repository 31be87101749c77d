"""Say in one sentence why a model gave no answer."""

from __future__ import annotations


class ModelUnavailable(RuntimeError):
    """No answer; the message is for the user and holds no secret.

    ``transient`` tells whether the same question may be answered a little later;
    ``wait_s`` is how long the server asks to wait, None if it does not say.
    """

    def __init__(self, sentence: str, *, transient: bool = False, wait_s: float | None = None):
        super().__init__(sentence)
        self.transient = transient
        self.wait_s = wait_s
