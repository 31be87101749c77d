"""Hold a measured number against what it has to be."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """One measured number beside what it has to be."""

    name: str
    value: float
    limit: float
    unit: str
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the number is within its limit."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def line(self) -> str:
        """Return one line of the printed table."""
        sign = ">=" if self.at_least else "<="
        mark = "ok  " if self.holds else "MISS"
        return f"{mark}  {self.name:<44} {self.value:9.3f} {sign} {self.limit:g} {self.unit}"
