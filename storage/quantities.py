"""Read and write sizes and times as people do: ``50GB``, ``1.5 TiB``, ``90m``, ``30d``."""

from __future__ import annotations

import re

_BYTES = {
    "": 1, "b": 1,
    "kb": 10**3, "mb": 10**6, "gb": 10**9, "tb": 10**12, "pb": 10**15,
    "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12,
    "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40, "pib": 2**50,
}  # fmt: skip
_SECONDS = {"": 1, "s": 1, "m": 60, "min": 60, "h": 3600, "d": 86400, "w": 7 * 86400}
_QUANTITY = re.compile(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]*)\s*")


def parse_bytes(text: str) -> int:
    """Return the bytes that a text such as ``50GB`` or ``1.5 TiB`` means; else ValueError."""
    return int(_parse(text, _BYTES, "a size: write it like 50GB, 500 MB or 1.5TiB"))


def parse_seconds(text: str) -> float:
    """Return the seconds that a text such as ``90m``, ``24h`` or ``30d`` means; else ValueError."""
    return _parse(text, _SECONDS, "a time: write it like 30s, 90m, 24h, 30d or 2w")


def show_bytes(size: int) -> str:
    """Return a size with three digits, e.g. ``12.3 MB``."""
    amount, unit = float(size), "B"
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if amount < 999.5 or unit == "TB":
            break
        amount /= 1000
    return f"{amount:.0f} B" if unit == "B" else f"{amount:.3g} {unit}"


def _parse(text: str, units: dict[str, int], what: str) -> float:
    found = _QUANTITY.fullmatch(text)
    factor = units.get(found[2].lower()) if found else None
    if found is None or factor is None:
        raise ValueError(f"{text!r} is not {what}")
    return float(found[1]) * factor
