"""The scene package: what ``factorize`` writes to OUT/NAME (contents in docs/package.md)."""

PACKAGE_VERSION = 2
"""Raised when the files made from the same artifacts change."""
