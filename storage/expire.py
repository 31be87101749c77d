"""Remove what is kept for a while only: void leases and pins, evidence, old explanations."""

from __future__ import annotations

from collections import defaultdict
from contextlib import suppress

from storage import actions
from storage.errors import StoreError
from storage.forget import use_name
from storage.leases import leased_key
from storage.medium import Medium
from storage.pins import pin_documents, read_pin


def expire(medium: Medium, evidence_s: float, now: float) -> int:
    """Remove what is void or older than ``evidence_s`` seconds; return how many things."""
    return drop_void(medium) + _old_evidence(medium, now - evidence_s) + _stray_marks(medium)


def drop_void(medium: Medium) -> int:
    """Remove leases and pins that hold nothing any more; return how many."""
    keys = filter(None, map(leased_key, medium.names("leases/")))
    dropped = sum(medium.leases.drop_void(key) for key in keys)
    for document in list(pin_documents(medium)):
        with suppress(StoreError):  # an unreadable one is for repair
            pin = read_pin(medium, document)
            if pin is not None and pin.is_void():
                medium.delete(document)
                dropped += 1
    return dropped


def _old_evidence(medium: Medium, before: float) -> int:
    old = [name for name, written in medium.times("conflicts/") if written < before]
    known = set(medium.names("actions/"))
    old += [
        name
        for name, written in medium.times("latest/")
        if written < before and actions.pointed_action(medium, name) not in known
    ]
    medium.delete(*old)
    wards: dict[str, float] = defaultdict(float)
    for name, written in medium.times("quarantine/"):
        ward = "/".join(name.split("/")[:2]) + "/"
        wards[ward] = max(wards[ward], _admitted(ward, written))
    expired = [ward for ward, admitted in wards.items() if admitted < before]
    for ward in expired:
        medium.clear(ward)
    return len(old) + len(expired)


def _admitted(ward: str, written: float) -> float:
    """Return when something came into quarantine: its name ends with that (nanoseconds)."""
    digits = ward.rstrip("/").rpartition("-")[2]
    return int(digits) / 1e9 if digits.isdecimal() else written


def _stray_marks(medium: Medium) -> int:
    known = {
        use_name(actions.named_key(name))
        for name in medium.names("actions/")
        if actions.is_action_name(name)
    }
    stray = [name for name in medium.names("uses/") if name not in known]
    medium.delete(*stray)
    return len(stray)
