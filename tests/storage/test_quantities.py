"""Sizes and times as people write them."""

from __future__ import annotations

import pytest

from storage.quantities import parse_bytes, parse_seconds, show_bytes


@pytest.mark.parametrize(
    ("text", "size"),
    [("50GB", 50 * 10**9), ("1.5 TiB", 1.5 * 2**40), ("12", 12), ("7 k", 7000), ("3mib", 3 << 20)],
)
def test_sizes(text: str, size: float) -> None:
    assert parse_bytes(text) == size


@pytest.mark.parametrize(
    ("text", "seconds"), [("90m", 5400), ("24h", 86400), ("2w", 14 * 86400), ("30", 30)]
)
def test_times(text: str, seconds: float) -> None:
    assert parse_seconds(text) == seconds


@pytest.mark.parametrize("text", ["", "GB", "5zB", "-1", "1e3", "5 GB free", "٣"])
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="write it like"):
        parse_bytes(text)


@pytest.mark.parametrize(
    ("size", "text"),
    [(0, "0 B"), (999, "999 B"), (1000, "1 kB"), (999_900, "1 MB"), (12_345_678, "12.3 MB")],
)
def test_shown_with_three_digits(size: int, text: str) -> None:
    assert show_bytes(size) == text
