"""Hold what a model proposed: targets, its raw answers, and what its check changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

from garden_models.scene import OK, Target, Verdict

ChangeKind = Literal["added", "moved", "renamed", "removed"]


@dataclass(frozen=True)
class Query:
    """One question to a model and what it answered, word for word.

    ``model`` is what the server says answered; tokens are None if it does not count them.
    ``photos`` are those that it was shown.
    """

    purpose: Literal["propose", "critic"]
    prompt: str
    answer: str
    model: str
    photos: tuple[str, ...]
    input_tokens: int | None = None
    output_tokens: int | None = None


@dataclass(frozen=True)
class TargetChange:
    """What the check did to one target; ``before`` or ``after`` is None where there is none."""

    kind: ChangeKind
    before: Target | None
    after: Target | None
    why: str = ""


@dataclass(frozen=True)
class TargetProposal:
    """Targets in the form of boxes given by hand, and where they come from.

    ``proposed`` are those before the check. ``scores`` (0..1) are a detector's, one a
    target; a language model gives none. The verdict tells what was repaired or dropped.
    """

    SCHEMA: ClassVar[str] = "garden.TargetProposal/1"
    model: str
    goal: str
    targets: tuple[Target, ...]
    proposed: tuple[Target, ...]
    changes: tuple[TargetChange, ...] = ()
    queries: tuple[Query, ...] = ()
    scores: tuple[float, ...] = ()
    verdict: Verdict = OK
